//! Refining the receiving side of the mesh.

use std::f64::consts::SQRT_2;

use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::{PatchId, VertexId};
use crate::refinement::{Obstacle, Plan, Step, long_patches};
use crate::settings::BakeSettings;

/// Factor of the limit of refinement where the error was found too large and too few patches were divided,
pub const UNSEEN_STEP: f64 = 0.7;

/// as often as this.
const MOST_UNSEEN_STEPS: u32 = 12;

/// Part of the asked error that contrast is aimed at where rows are exact: there vertices cost little, and pictures show what is wrong
/// in dark places.
const CONTRAST_OF_EXACT: f64 = 0.45;

/// What refinement is to reach, and how far it may go.
pub struct Aim {
    /// Expected interpolation error at which it ends.
    pub limit: f64,
    /// Vertices to reach at least: the prediction did not see what was found, and measuring the same mesh again would only draw other
    /// samples.
    pub least_vertices: usize,
    /// Most vertices, where there are fewer than the settings allow.
    pub most_vertices: usize,
}

/// A bake on a refined mesh, solved for with the means over it.
pub struct Refined {
    pub solved: Solved,
    /// Why refinement ended before its limit was met.
    pub obstacle: Option<Obstacle>,
}

impl Solved {
    /// Divides patches where interpolation is wrong, round by round, until its error is expected to be under the limit of the aim, and
    /// its contrast under that of the settings, or the mesh has as many vertices as the aim allows. Then solves again.
    ///
    /// Where there must be more vertices, the limit is lowered until there are, or something is in the way.
    #[tracing::instrument(skip_all)]
    pub fn refine(mut self, cx: &mut Context, aim: &mut Aim) -> Result<Refined> {
        let most_of_settings = cx.settings.most_vertices(cx.scene);
        let most_vertices = aim.most_vertices.min(most_of_settings);
        let mut plan = Plan {
            limit: aim.limit,
            contrast: self.contrast(cx.settings),
            found_per_predicted: self.found_per_predicted,
            shortest_edge: cx.shortest_edge(),
            max_vertices: most_vertices,
        };
        let before = self.mesh.mesh.vertices.len();
        let mut steps_left = MOST_UNSEEN_STEPS;
        let mut prediction = self.predict(cx, &self.fitted());
        // New vertices only receive: neither rows nor radiosity change here.
        let noise = self.noise();
        let obstacle = loop {
            // The corners of others would keep the light of the middle.
            let has_own_receivers = |id: PatchId| {
                let corners = &self.mesh.mesh.patch(id).corners;
                !self.rows.table.vertices.is_one(corners)
            };
            match plan.next(&self.mesh.mesh, &prediction, noise, has_own_receivers) {
                Step::Done if steps_left > 0 && self.mesh.mesh.vertices.len() < aim.least_vertices => {
                    steps_left -= 1;
                    plan.limit *= UNSEEN_STEP;
                }
                Step::Done => break None,
                Step::Stop(obstacle) => break Some(obstacle),
                Step::Divide(patches) => {
                    if !self.divide(cx, patches, most_vertices)? {
                        break Some(Obstacle::MaxVertices);
                    }
                    prediction = self.predict(cx, &self.fitted());
                    self.preview(cx);
                }
            }
        };
        let has_grown = self.mesh.mesh.vertices.len() > before;
        let obstacle = obstacle.filter(|cause| match cause {
            // Reaching the aim's own bound is no obstacle: the next round has a larger one.
            Obstacle::MaxVertices => most_vertices == most_of_settings,
            // A lowered limit may be out of reach where the aim's own is not: the new vertices will tell.
            Obstacle::Noise | Obstacle::SmallPatches => plan.limit == aim.limit || !has_grown,
        });
        aim.limit = plan.limit;
        cx.end_step("refine");
        self.final_solve(cx)?;
        Ok(Refined { solved: self, obstacle })
    }

    /// Contrast of errors at which refinement ends.
    fn contrast(&self, settings: &BakeSettings) -> f64 {
        let is_exact = self.rows.source.leaves_cost_rows();
        let most = if is_exact { CONTRAST_OF_EXACT * settings.asked_error() } else { f64::INFINITY };
        settings.contrast.map_or(f64::INFINITY, |contrast| contrast.min(most))
    }

    /// Divides patches until none is longer than was asked for, or there are as many vertices as may be.
    pub fn divide_long(&mut self, cx: &mut Context) -> Result<()> {
        // A patch's diagonals, too, may become edges of triangles.
        let longest = |edge: f64| edge / cx.scene.frame.scale / SQRT_2;
        let Some(longest) = cx.settings.max_edge.map(longest) else { return Ok(()) };
        let most = cx.settings.most_vertices(cx.scene);
        loop {
            let long = long_patches(&self.mesh.mesh, longest, most);
            if long.is_empty() || !self.divide(cx, long, most)? {
                return Ok(());
            }
        }
    }

    /// Divides patches, as far as the mesh may have more vertices: false where it could have none.
    fn divide(&mut self, cx: &mut Context, mut patches: Vec<PatchId>, most: usize) -> Result<bool> {
        let mesh = &mut self.mesh.mesh;
        let first = VertexId(mesh.vertices.len() as u32);
        // Vertices follow each other in the order of their patches.
        mesh.sort_by_place(&mut patches);
        for id in patches {
            if !mesh.divide_within(id, most) {
                break;
            }
        }
        if mesh.vertices.len() == first.index() {
            return Ok(false);
        }
        cx.work.rounds += 1;
        self.receive(cx, first)?;
        Ok(true)
    }
}
