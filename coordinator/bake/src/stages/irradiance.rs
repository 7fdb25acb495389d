//! Irradiance at any receivers, from a solution: the one way to get it.

use glam::DVec3;
use kernel::replica::Receivers;

use super::glow::{add, glow};
use super::light::{self, Direct};
use super::light_source::LightSource;
use crate::context::Context;
use crate::error::Result;
use crate::rows::{Cover, Gathered, Radiosity, Rows, ShareMesh};
use crate::solver::cache::SetId;

/// Where irradiance is wanted.
#[derive(Clone, Copy)]
pub enum Place<'a> {
    /// At a set of the table, whose rows are kept.
    Kept(SetId),
    /// At other receivers, whose rows are needed once.
    Once(&'a Receivers),
    /// At many other receivers, whose light may be interpolated as that of vertices is.
    Many(&'a Receivers),
}

/// Light of some sources, with the radiosity that they give the shares.
pub struct Lights<'a> {
    /// The sources.
    pub sources: &'a [LightSource],
    /// Radiosity of the shares.
    pub radiosity: Radiosity<'a>,
}

/// Irradiance of some receivers.
pub struct Irradiance {
    /// Straight from the sources.
    pub direct: Direct,
    /// The part of it that comes from what glows; empty where nothing does.
    pub glow: Vec<DVec3>,
    /// In all.
    pub all: Vec<DVec3>,
}

/// Irradiance of receivers from each of some lights, and what they see.
pub struct Received {
    pub light: Vec<Irradiance>,
    /// Of receivers that are asked about once, only the sums are known.
    pub cover: Cover,
}

/// Irradiance at a place from each of these lights, in one pass over the rows of the shares.
pub fn irradiance_at(
    cx: &mut Context,
    mesh: &ShareMesh,
    rows: &mut Rows,
    place: Place,
    lights: &[Lights],
) -> Result<Received> {
    let Rows { source, table } = rows;
    let set = match place {
        Place::Kept(id) => table.set(id),
        Place::Once(receivers) | Place::Many(receivers) => cx.client.publish_receivers(receivers),
    };
    let mut direct = vec![];
    for light in lights {
        direct.push(light::direct(light.sources, set, cx.client)?);
    }
    let sky_views = direct.iter().find_map(|direct| direct.sky_views.as_deref());
    let glows: Vec<Option<Vec<DVec3>>> = lights.iter().map(|light| glow(mesh, light.sources)).collect();
    let reflected = lights.iter().map(|light| light.radiosity);
    let even = glows.iter().flatten().map(|glow| Radiosity::even(glow));
    let radiosities: Vec<Radiosity> = reflected.chain(even).collect();
    let Gathered { light, cover } = match place {
        Place::Kept(id) => {
            sky_views.into_iter().for_each(|views| source.see_sky(id, views));
            source.gather(cx, mesh, table, &[id], &radiosities, true)?.pop().unwrap_or_default()
        }
        Place::Once(receivers) => {
            let gathered = source.gather_once(cx, mesh, table, (set, receivers), &radiosities)?;
            cx.client.release(set);
            gathered
        }
        Place::Many(receivers) => {
            let gathered = source.gather_many(cx, mesh, table, (set, receivers, sky_views), &radiosities)?;
            cx.client.release(set);
            gathered
        }
    };
    let mut light = light.into_iter();
    let reflected: Vec<Vec<DVec3>> = light.by_ref().take(lights.len()).collect();
    let light = direct.into_iter().zip(reflected).zip(&glows).map(|((mut direct, reflected), glows)| {
        let glow = if glows.is_some() { light.next().unwrap_or_default() } else { vec![] };
        add(&mut direct.all, &glow);
        let all = direct.all.iter().zip(reflected).map(|(direct, light)| *direct + light).collect();
        Irradiance { direct, glow, all }
    });
    Ok(Received { light: light.collect(), cover })
}
