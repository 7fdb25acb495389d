//! Irradiance at any receivers, from a solution: the one way to get it.

use glam::DVec3;
use kernel::replica::Receivers;
use kernel::row::Row;

use super::light::{self, LightSource};
use crate::channels::Gathering;
use crate::context::Context;
use crate::error::Result;
use crate::rows::Rows;
use crate::solver::ShareId;
use crate::solver::cache::SetId;

/// Where irradiance is wanted.
#[derive(Clone, Copy)]
pub enum Place<'a> {
    /// At a set of the table, whose rows are kept.
    Kept(SetId),
    /// At other receivers, whose rows are needed once.
    Once(&'a Receivers),
}

/// Light of some sources, with the radiosity that they give the shares.
pub struct Lights<'a> {
    /// The sources.
    pub sources: &'a [LightSource],
    /// Radiosity of each share.
    pub radiosity: &'a [DVec3],
}

/// Irradiance of some receivers.
pub struct Irradiance {
    /// Straight from the sources.
    pub direct: Vec<DVec3>,
    /// In all.
    pub all: Vec<DVec3>,
}

/// Irradiance at a place from each of these lights, in one pass over the rows of the shares. `look` sees each of these rows.
pub fn irradiance_at(
    cx: &mut Context,
    rows: &mut Rows,
    place: Place,
    lights: &[Lights],
    mut look: impl FnMut(ShareId, &Row),
) -> Result<Vec<Irradiance>> {
    let set = match place {
        Place::Kept(id) => rows.table.set(id),
        Place::Once(receivers) => cx.client.publish_receivers(receivers),
    };
    let mut direct = vec![];
    for light in lights {
        direct.push(light::irradiance(light.sources, set, cx.client, |_, _, _| ())?);
    }
    let mut gathered: Vec<Gathering> = lights.iter().map(|_| cx.channels.gathering(set.count())).collect();
    let mut take = |share: ShareId, row: &Row| {
        for (gathered, light) in gathered.iter_mut().zip(lights) {
            gathered.add(row, light.radiosity[share.index()]);
        }
        look(share, row);
    };
    match place {
        Place::Kept(id) => rows.table.each(
            cx.client,
            &[id],
            |_| true,
            |share, rows| rows.into_iter().flatten().for_each(|row| take(share, row)),
        )?,
        Place::Once(receivers) => {
            rows.source.each_over(cx, &rows.table, (set, receivers), &mut take)?;
            cx.client.release(set);
        }
    }
    let irradiance = |(direct, gathered): (Vec<DVec3>, Gathering)| {
        let gathered = gathered.into_irradiance();
        let all = direct.iter().zip(gathered).map(|(direct, light)| *direct + light).collect();
        Irradiance { direct, all }
    };
    Ok(direct.into_iter().zip(gathered).map(irradiance).collect())
}
