//! Where gather points lie: the more of them, the worse interpolation between them is.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::occluder::Occluder;
use kernel::replica::Receiver;
use kernel::row::Shooter;
use rayon::prelude::*;

use super::GatherRows;
use super::hemisphere::{View, gathered, hemispheres, views};
use super::interpolation::{Neighbours, Weights, interpolated};
use super::nearest::{Nearest, take_nearer};
use super::noise::{TWINS, Twins};
use super::rays;
use super::sky::factor_by_sky;
use super::weigh::cell;
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::{INTERPOLATED_NOISE, without_noise};
use crate::mesh::{Mesh, Patch, PatchId};
use crate::refinement::{Cap, MOST_DRAWN, SamplePoints, parts_of_both};
use crate::rows::means::ShareValues;
use crate::rows::share_mesh::ShareMesh;
use crate::rows::{COARSE, leaving};
use crate::solver::ShareEnergy;
use scene::{Facet, Scene};

/// Meshes of no more receivers cast rays from each.
pub(super) const FEW_RECEIVERS: usize = 1 << 13;

/// Points to begin with.
pub(super) const FIRST_POINTS: usize = 1024;

/// Points are added up to this number,
const MANY_POINTS: usize = 1 << 13;

/// and beyond, up to this one, as long as half as many again leave no more than this part of the error, and the last two times together
/// no more than its square: elsewhere the error is that of few places, hidden in others.
pub(super) const MOST_POINTS: usize = 1 << 15;

/// See [`MOST_POINTS`].
const LEAST_GAIN: f64 = 0.84;

/// An error under this part of the one before is not believed: half as many points again do not lessen it so far, even where it falls with
/// the square of their number. Those that tell it may have missed a few bright places.
const LEAST_BELIEVED: f64 = 0.4;

/// Size of the cells whose leaves are taken to have one nearest point while points are placed, relative to the scene's extent.
const ONE_PLACE: f64 = 0.01;

/// Part of the asked error that interpolation between the points may have.
const PART: f64 = 0.4;

/// Key of the first point as a receiver, above those of all samples.
const FIRST_KEY: u64 = 1 << 36;

/// Rounds of drawing, each with seeds of its own: above those of samples.
const FIRST_ROUND: u32 = 1 << 16;

/// Passes in which light goes between points and shares before points are added: enough to tell where it changes.
const PASSES: u32 = 8;

impl GatherRows {
    /// Places gather points until the light between them is known as well as the asked error wants it. Returns a first radiosity of the
    /// shares, given the direct light of the vertices, and what the shares emit beside it.
    pub(super) fn place(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        direct: &[DVec3],
        glow: Option<&[DVec3]>,
    ) -> Result<Vec<DVec3>> {
        let values = ShareValues::means(mesh, &vec![true; direct.len()]);
        let direct = values.of(&mesh.energies, direct);
        let radiosity: Vec<DVec3> =
            mesh.energies.iter().zip(&direct).map(|(share, light)| share.reflectance * *light).collect();
        if self.sets[COARSE.index()].receivers.len() <= FEW_RECEIVERS {
            self.place_twins(cx, mesh)?;
            return Ok(radiosity);
        }
        self.place_by_light(cx, mesh, (radiosity, glow), Some(&direct), MOST_POINTS)
    }

    /// Places up to this number of points by the light of the shares. Where their direct light is given, the rest is found on the way.
    /// Returns their radiosity.
    pub(super) fn place_by_light(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        (mut radiosity, glow): (Vec<DVec3>, Option<&[DVec3]>),
        direct: Option<&[DVec3]>,
        most: usize,
    ) -> Result<Vec<DVec3>> {
        let Some(polygons) = self.polygons else { return Ok(radiosity) };
        let asked = cx.settings.asked_error();
        let (middles, of_leaves) = middles(cx, &mesh.mesh);
        let (mut expected, mut errors_so_far) = (vec![], vec![]);
        let mut nearest = vec![Nearest::default(); middles.len()];
        let mut count = FIRST_POINTS;
        for round in 0.. {
            let (drawn, looking, seen) = self.look_around(cx, &mesh.mesh, &expected, count)?;
            let receivers = drawn.receivers(count).receivers;
            let known = if round > 0 { self.neighbours(cx) } else { None };
            let at_fresh =
                known.map(|known| self.errors_at(&receivers, &seen, &leaving(&radiosity, glow), &known));
            let known_points = self.points.receivers.len() as u32;
            self.points.add_placed(looking, seen);
            if round == 0 {
                self.twins = Twins::look(cx.client, polygons, drawn.clone(), rays::of_point(cx.settings))?;
            }
            let Some(neighbours) = self.neighbours(cx) else { break };
            // Near enough to tell where points are needed.
            take_nearer(&mut nearest, &middles, &self.points.receivers, known_points, cx.extent());
            if let Some(direct) = direct {
                let of_leaf = |leaf: usize| nearest[of_leaves[leaf] as usize].point;
                radiosity = self.passed_on(mesh, (radiosity, glow), direct, of_leaf);
            }
            let all_light = leaving(&radiosity, glow);
            let lights = self.points.gather(&all_light);
            let left_out = self.errors_left_out(&lights, &neighbours);
            let errors: &[DVec3] = at_fresh.as_ref().unwrap_or(&left_out);
            let square = |(share, b): (&ShareEnergy, &DVec3)| (b.length_squared(), share.area);
            let places: Vec<(f64, f64)> = mesh.energies.iter().zip(&radiosity).map(square).collect();
            let caps = [Cap::NONE, Cap::over(places.clone())];
            let fresh = (&drawn, errors, &lights[known_points as usize..]);
            let [plain, capped] = caps.map(|cap| self.error_under(cap, &places, fresh, &all_light));
            let error = plain.max(capped);
            tracing::debug!(points = self.points.placed, plain, capped, "gather points placed");
            // One estimate that is far too high makes the next ones look like progress.
            let mut gains = [LEAST_GAIN, LEAST_GAIN.powi(2)].into_iter().zip(errors_so_far.iter().rev());
            let helps = gains.all(|(gain, before)| error <= gain * before);
            // The first was told by other points than fresh ones.
            let believed =
                errors_so_far.iter().skip(1).last().is_none_or(|before| error >= LEAST_BELIEVED * before);
            errors_so_far.push(error);
            let most = most.min(if helps { MOST_POINTS } else { MANY_POINTS });
            // Fresh points alone tell of places where no others lie.
            if at_fresh.is_some() && error <= PART * asked && believed || self.points.placed >= most {
                break;
            }
            let squares_under = |cap: Cap| -> Vec<f64> {
                let square = |((_, patch), middle): ((PatchId, &Patch), &u32)| {
                    let reflectance = cx.scene.surfaces[patch.surface as usize].reflectance;
                    let point = nearest[*middle as usize].point as usize;
                    let [error, radiosity] =
                        [left_out[point], lights[point]].map(|light| (reflectance * light).length_squared());
                    patch.area * error * cap.part(radiosity)
                };
                mesh.mesh.leaves().zip(&of_leaves).map(square).collect()
            };
            let [all, capped] = caps.map(squares_under);
            expected = parts_of_both(&all, &capped);
            count = (self.points.placed / 2).clamp(FIRST_POINTS, MOST_DRAWN);
        }
        Ok(radiosity)
    }

    /// Error of the light at fresh points, relative to that of the shares, which are these places: both under a cap.
    fn error_under(
        &self,
        cap: Cap,
        places: &[(f64, f64)],
        (points, errors, light): (&SamplePoints, &[DVec3], &[DVec3]),
        radiosity: &[DVec3],
    ) -> f64 {
        let norm = cap.norm(places);
        let area: f64 = places.iter().map(|place| place.1).sum();
        let relative = |square: f64| if norm > 0.0 { (square * area / norm).sqrt() } else { 0.0 };
        // The fresh light is noisy, and so is that between the points, less. Under an even sky a small part of both cancels: what a point
        // sees of it the same rays tell.
        let square_noise = self.twins.square_noise(&self.points, radiosity, cap);
        let noise = relative(square_noise * (1.0 + INTERPOLATED_NOISE));
        without_noise(relative(points.mean_square_error(errors, light, cap)), noise)
    }

    /// Radiosity of the shares after some passes between points and shares, each of which is a leaf that has the light of one point.
    fn passed_on(
        &self,
        mesh: &ShareMesh,
        (mut radiosity, glow): (Vec<DVec3>, Option<&[DVec3]>),
        direct: &[DVec3],
        of_leaf: impl Fn(usize) -> u32 + Sync,
    ) -> Vec<DVec3> {
        for _ in 0..PASSES {
            let light = self.points.gather(&leaving(&radiosity, glow));
            let of_share = |(leaf, (share, direct)): (usize, (&ShareEnergy, &DVec3))| {
                share.reflectance * (*direct + light[of_leaf(leaf) as usize])
            };
            let all = mesh.energies.par_iter().zip(direct).enumerate().with_min_len(1024);
            radiosity = all.map(of_share).collect();
        }
        radiosity
    }

    /// Draws points by the square error that is expected in each leaf, and looks at the shares from them.
    pub(super) fn look_around(
        &mut self,
        cx: &mut Context,
        mesh: &Mesh,
        expected: &[f64],
        count: usize,
    ) -> Result<(SamplePoints, Vec<Shooter>, Vec<View>)> {
        let Some(polygons) = self.polygons else { return Ok(Default::default()) };
        let seed = (cx.settings.seed, FIRST_ROUND + self.rounds);
        let first_key = FIRST_KEY + u64::from(self.rounds) * MOST_DRAWN as u64;
        self.rounds += 1;
        let drawn = SamplePoints::draw_everywhere(mesh, cx.scene, seed, first_key, expected, count);
        let rays = rays::of_point(cx.settings);
        let looking = hemispheres(&drawn.receivers(count), |_| rays);
        let mut look = || views(cx.client, polygons, &looking);
        let seen = if self.occluder.is_some() {
            look()?
        } else {
            let facets = || cx.scene.front_facets().map(Facet::polygon).collect::<Vec<ConvexPolygon>>();
            // While a worker sorts the polygons of its first job.
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| self.occluder = Some(Occluder::new(&facets())));
                look()
            })?
        };
        Ok((drawn, looking, seen))
    }

    /// Places points only to measure the noise, where each receiver casts rays of its own.
    fn place_twins(&mut self, cx: &mut Context, mesh: &ShareMesh) -> Result<()> {
        let Some(polygons) = self.polygons else { return Ok(()) };
        let seed = (cx.settings.seed, FIRST_ROUND);
        let drawn = SamplePoints::draw_everywhere(&mesh.mesh, cx.scene, seed, FIRST_KEY, &[], TWINS);
        let rays = rays::of_receiver(cx.settings);
        let looking = hemispheres(&drawn.receivers(TWINS), |_| rays);
        let seen = views(cx.client, polygons, &looking)?;
        self.points.add_alone(looking, seen);
        self.twins = Twins::look(cx.client, polygons, drawn, rays)?;
        Ok(())
    }

    /// Errors of interpolation at receivers with these views. Where one sees no point all of its light is missing: vertices there will get
    /// rays of their own, but what lies between these is not known.
    fn errors_at(
        &self,
        receivers: &[Receiver],
        views: &[View],
        radiosity: &[DVec3],
        neighbours: &Neighbours,
    ) -> Vec<DVec3> {
        let known = self.points.gather(radiosity);
        let sky_views = self.points.sky_views();
        let error = |(receiver, view): (&Receiver, &View)| {
            let weights = neighbours.weights(receiver, 0.0, None);
            self.between(weights, (&known, &sky_views), view) - gathered(view, radiosity)
        };
        receivers.par_iter().zip(views).with_min_len(64).map(error).collect()
    }

    /// Light of a receiver with this view, between points whose light and sky view factors are known; none where it sees no point.
    fn between(
        &self,
        weights: Option<Weights>,
        (known, sky_views): (&[DVec3], &[DVec3]),
        view: &View,
    ) -> DVec3 {
        let Some(weights) = weights else { return DVec3::ZERO };
        let light = interpolated(&weights, known);
        if !self.has_even_sky {
            return light;
        }
        light * factor_by_sky(f64::from(view.sky), interpolated(&weights, sky_views).x)
    }

    /// Errors of interpolation at the points, given their light, where each is left out itself.
    fn errors_left_out(&self, light: &[DVec3], neighbours: &Neighbours) -> Vec<DVec3> {
        let sky_views = self.points.sky_views();
        let points = self.points.receivers[..self.points.shared].par_iter().zip(&self.points.views);
        let error = |(point, (receiver, view)): (usize, (&Receiver, &View))| {
            let weights = neighbours.weights(receiver, 0.0, Some(point as u32));
            self.between(weights, (light, &sky_views), view) - light[point]
        };
        points.enumerate().with_min_len(64).map(error).collect()
    }
}

/// Receivers in the middle of leaves, and the index of one for each leaf: those in one small cell and of one main direction share one.
fn middles(cx: &Context, mesh: &Mesh) -> (Vec<Receiver>, Vec<u32>) {
    let (mut middles, mut in_cells) = (vec![], HashMap::new());
    let of_leaf = |(id, _)| {
        let middle = middle(cx.scene, mesh, id);
        *in_cells.entry(cell(&middle, ONE_PLACE * cx.extent())).or_insert_with(|| {
            middles.push(middle);
            middles.len() as u32 - 1
        })
    };
    let of_leaves = mesh.leaves().map(of_leaf).collect();
    (middles, of_leaves)
}

/// A receiver in the middle of a leaf.
fn middle(scene: &Scene, mesh: &Mesh, id: PatchId) -> Receiver {
    let patch = mesh.patch(id);
    let facet = &scene.surfaces[patch.surface as usize].facets[patch.facet as usize];
    Receiver { position: mesh.centre(id), normal: facet.normal, plane: facet.plane }
}
