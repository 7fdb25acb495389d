//! Why an error is not met, in words for the user.

use super::Measured;
use super::judge::is_balanced;
use crate::context::Context;
use crate::refinement::Obstacle;
use crate::solver::balance::EnergyBalance;

impl Measured {
    /// Why the asked error is not met, in words for the user.
    pub fn describe_obstacle(&self, cx: &Context) -> Option<String> {
        let settings = cx.settings;
        if settings.error.is_some() && self.is_predicted() {
            let why = if settings.validation_samples > 0 {
                "no surface reflects diffuse light"
            } else {
                "give --validation-samples"
            };
            return Some(format!("the error asked for was predicted, not measured: {why}"));
        }
        let asked = settings.asked_error();
        let estimate = if settings.error.is_some() { self.error.total } else { self.error.receivers };
        if estimate <= asked {
            return None;
        }
        let error = &self.error;
        let interpolation = "interpolation between the vertices";
        let receivers = if self.between > self.of_mesh() {
            "light between gather points, of which a bake has a limited number: for a small scene give --rows exact"
                .to_owned()
        } else {
            self.obstacle
                .map_or(interpolation.to_owned(), |cause| format!("{interpolation}: {}", cause.describe()))
        };
        let parts = [
            (error.receivers, receivers),
            (error.shooters, "the size of the shooting patches: raise --max-vertices, or give a finer --shooter-edge with --mesh-error".to_owned()),
            (error.visibility, "sampled visibility: raise --rays or --exact-occluders".to_owned()),
            (error.form_factors, "the arithmetic of form factors: lower --form-factor-error and --factor-rounding".to_owned()),
            (error.unshot, "unshot light: lower --threshold".to_owned()),
        ];
        let (_, part) = if settings.error.is_some() {
            parts.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?
        } else {
            parts.into_iter().next()?
        };
        Some(format!(
            "an error of {:.2} % was asked for and {:.2} % is estimated: limited by {part}",
            100.0 * asked,
            100.0 * estimate
        ))
    }

    /// What the balance tells that the estimated error does not, in words for the user.
    pub fn describe_imbalance(&self, cx: &Context, balance: &EnergyBalance) -> Option<String> {
        let asked = cx.settings.error.map(|asked| (asked, self.error.total <= asked));
        (!is_balanced(balance)).then(|| imbalance(balance.relative_imbalance(), asked, self.obstacle))
    }
}

/// The imbalance in words. `asked`: the error asked for, if any, and whether it is met as far as was estimated.
fn imbalance(relative: f64, asked: Option<(f64, bool)>, obstacle: Option<Obstacle>) -> String {
    let what = if relative > 0.0 { "missing" } else { "too much" };
    let light = format!("{:.1} % of the emitted light is {what}", 100.0 * relative.abs());
    match asked {
        None => format!("{light}: the error may be larger than is said; lower --mesh-error"),
        // Another warning says why.
        Some((_, false)) => format!("{light}: the error may be larger than is said"),
        Some((asked, true)) => {
            let asked = 100.0 * asked;
            let cure = obstacle.and_then(Obstacle::cure).unwrap_or("lower --error");
            format!("an error of {asked:.2} % was asked for and may not be met: {light}; {cure}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_imbalance_comes_with_the_cure_that_fits() {
        let met = imbalance(0.034, Some((0.05, true)), None);
        let words =
            "an error of 5.00 % was asked for and may not be met: 3.4 % of the emitted light is missing";
        assert_eq!(met, format!("{words}; lower --error"));
        let ended = imbalance(0.034, Some((0.05, true)), Some(Obstacle::MaxVertices));
        assert_eq!(ended, format!("{words}; raise --max-vertices"));
        let missed = imbalance(-0.2, Some((0.05, false)), None);
        assert_eq!(missed, "20.0 % of the emitted light is too much: the error may be larger than is said");
        assert!(imbalance(0.034, None, None).ends_with("lower --mesh-error"));
    }
}
