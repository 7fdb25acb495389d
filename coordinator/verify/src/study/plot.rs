//! The work-precision plot: error over time, and FLIP where it is known, all logarithmic, one curve a knob.

use std::io;
use std::ops::RangeInclusive;

use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::curve::LEAST_ERROR;
use super::{Circumstances, Curve, Measurement, Point, points};

/// Width of the picture, and heights of its heading, of each panel and of the legend.
const WIDTH: u32 = 960;
const HEADING: u32 = 56;
const PANEL: u32 = 520;
const LEGEND: u32 = 64;

/// Dark enough to read on white.
const TEXT: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(217, 217, 217);

/// Free space at the ends of an axis, as a factor.
const MARGIN: f64 = 1.4;

/// Why there is no plot.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The drawing failed.
    #[error("the plot cannot be drawn: {0}")]
    Drawing(#[from] DrawingAreaErrorKind<io::Error>),
}

/// What a panel shows over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Error,
    Flip,
}

impl Quantity {
    /// Its value at a point that has a place on logarithmic axes.
    fn of(self, point: &Point) -> Option<f64> {
        let value = match self {
            Self::Error => point.error,
            Self::Flip => point.flip?.mean,
        };
        (value.is_finite() && point.seconds > 0.0).then_some(value.max(LEAST_ERROR))
    }

    fn title(self) -> &'static str {
        match self {
            Self::Error => "relative L2 error of the radiosity",
            Self::Flip => "FLIP, mean of the pictures",
        }
    }

    /// Values that every plot shows, so that plots of different scenes look alike.
    fn always_shown(self) -> (f64, f64) {
        match self {
            Self::Error => (0.009, 0.12),
            Self::Flip => (0.018, 0.12),
        }
    }

    fn label(self, value: f64) -> String {
        match self {
            Self::Error => format!("{} %", short(value * 100.0)),
            Self::Flip => short(value),
        }
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Pixel = (i32, i32);

/// The plot as SVG.
///
/// # Errors
/// When it cannot be drawn.
pub fn svg(circumstances: &Circumstances, measurements: &[Measurement]) -> Result<String, PlotError> {
    let curves = Curve::ALL.map(|curve| (curve, points(measurements, curve)));
    let has_flip = curves.iter().flat_map(|(_, points)| points).any(|point| point.flip.is_some());
    let quantities = if has_flip { &[Quantity::Error, Quantity::Flip][..] } else { &[Quantity::Error] };
    let height = HEADING + PANEL * quantities.len() as u32 + LEGEND;
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        heading(&root, circumstances)?;
        for (quantity, index) in quantities.iter().zip(0..) {
            panel(&root, (HEADING + PANEL * index) as i32, *quantity, &curves)?;
        }
        legend(&root, &curves)?;
    }
    Ok(text)
}

fn heading(root: &Area<'_>, about: &Circumstances) -> Result<(), PlotError> {
    let centre = WIDTH as i32 / 2;
    write(root, &format!("{}: error over time", about.scene), (centre, 26), 26.0, TEXT, HPos::Center)?;
    let runs = if about.runs == 1 { "one run".to_owned() } else { format!("median of {} runs", about.runs) };
    let subtitle = format!("{}, {}, {runs}", about.machine, about.workers);
    write(root, &subtitle, (centre, 53), 16.0, TEXT, HPos::Center)
}

/// A quantity over time, from this height of the picture on.
fn panel(
    root: &Area<'_>,
    top: i32,
    quantity: Quantity,
    curves: &[(Curve, Vec<Point>)],
) -> Result<(), PlotError> {
    let shown = |points: &[Point]| -> Vec<(f64, f64, Option<f64>)> {
        let place = |point: &Point| Some((point.seconds, quantity.of(point)?, point.setting.value));
        points.iter().filter_map(place).collect()
    };
    let curves: Vec<_> = curves.iter().map(|(curve, points)| (*curve, shown(points))).collect();
    let all = || curves.iter().flat_map(|(_, points)| points);
    let seconds = range(all().map(|point| point.0), (f64::MAX, f64::MIN), (0.1, 10.0));
    let values = range(all().map(|point| point.1), quantity.always_shown(), quantity.always_shown());
    let [second_ticks, value_ticks] = [&seconds, &values].map(ticks);
    let mut chart = ChartBuilder::on(&root.clone().shrink((0, top), (WIDTH, PANEL)))
        .margin_top(16)
        .margin_left(14)
        .margin_right(28)
        .x_label_area_size(52)
        .y_label_area_size(80)
        .build_cartesian_2d(
            (*seconds.start()..*seconds.end()).log_scale().with_key_points(second_ticks),
            (*values.start()..*values.end()).log_scale().with_key_points(value_ticks),
        )?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .axis_style(TEXT)
        .label_style(("sans-serif", 17).into_font().color(&TEXT))
        .axis_desc_style(("sans-serif", 17).into_font().color(&TEXT))
        .x_desc("wall time from file to lit file")
        .y_desc(quantity.title())
        .x_label_formatter(&|seconds| format!("{} s", short(*seconds)))
        .y_label_formatter(&|value| quantity.label(*value))
        .draw()?;
    for (curve, points) in &curves {
        let places: Vec<Pixel> =
            points.iter().map(|point| chart.backend_coord(&(point.0, point.1))).collect();
        if places.len() > 1 {
            root.draw(&PathElement::new(places.clone(), colour(*curve).stroke_width(width(*curve))))?;
        }
        for ((_, _, value), &place) in points.iter().zip(&places) {
            mark(root, *curve, place)?;
            if let (Curve::Together, Some(value)) = (curve, value) {
                // Other curves come from the right.
                let beside = (place.0 - 7, place.1 + 12);
                write(root, &value.to_string(), beside, 15.0, colour(*curve), HPos::Right)?;
            }
        }
    }
    Ok(())
}

/// From the least to the largest value and those of `at_least`, with space at both ends; `otherwise` where there is no value.
fn range(
    values: impl Iterator<Item = f64>,
    at_least: (f64, f64),
    otherwise: (f64, f64),
) -> RangeInclusive<f64> {
    let (low, high) =
        values.fold(at_least, |(low, high), value| (low.min(value / MARGIN), high.max(value * MARGIN)));
    if low < high { low..=high } else { otherwise.0..=otherwise.1 }
}

/// Where gridlines stand: 1, 2, 3 and 5 of every power of ten; only those where they would stand too close.
fn ticks(range: &RangeInclusive<f64>) -> Vec<f64> {
    let decades = (range.end() / range.start()).log10();
    let digits: &[f64] = if decades < 3.0 { &[1.0, 2.0, 3.0, 5.0] } else { &[1.0] };
    let powers = range.start().log10().floor() as i32..=range.end().log10().ceil() as i32;
    // Parsed from decimal, so that .03 is the .03 of everybody else.
    let value = |digit: f64, power: i32| format!("{digit}e{power}").parse().unwrap_or(f64::NAN);
    powers
        .flat_map(|power| digits.iter().map(move |&digit| value(digit, power)))
        .filter(|tick| range.contains(tick))
        .collect()
}

/// A number of an axis, without the digits that multiplication by 100 leaves behind.
fn short(value: f64) -> String {
    format!("{value:.3e}").parse().unwrap_or(value).to_string()
}

/// Colours that the colour-blind can tell apart, after M. Okabe and K. Ito, *Color Universal Design*, 2008.
fn colour(curve: Curve) -> RGBColor {
    match curve {
        Curve::Together => RGBColor(213, 94, 0),
        Curve::Depth => RGBColor(0, 114, 178),
        Curve::Threshold => RGBColor(0, 158, 115),
        Curve::Rays => RGBColor(204, 121, 167),
        Curve::Defaults => RGBColor(0, 0, 0),
    }
}

fn width(curve: Curve) -> u32 {
    if curve == Curve::Together { 3 } else { 2 }
}

/// Draws a curve's marker: disc, square, triangle, diamond, cross.
fn mark(root: &Area<'_>, curve: Curve, place: Pixel) -> Result<(), PlotError> {
    let at = |offsets: &[Pixel]| -> Vec<Pixel> {
        offsets.iter().map(|(x, y)| (place.0 + x, place.1 + y)).collect()
    };
    let style = colour(curve).filled();
    match curve {
        Curve::Together => root.draw(&Circle::new(place, 6, style))?,
        Curve::Depth => root.draw(&Polygon::new(at(&[(-5, -5), (5, -5), (5, 5), (-5, 5)]), style))?,
        Curve::Threshold => root.draw(&Polygon::new(at(&[(0, -7), (6, 5), (-6, 5)]), style))?,
        Curve::Rays => root.draw(&Polygon::new(at(&[(0, -7), (7, 0), (0, 7), (-7, 0)]), style))?,
        Curve::Defaults => root.draw(&Cross::new(place, 7, colour(curve).stroke_width(3)))?,
    }
    Ok(())
}

/// Names the curves that were run under the plot.
fn legend(root: &Area<'_>, curves: &[(Curve, Vec<Point>)]) -> Result<(), PlotError> {
    let bottom = root.dim_in_pixel().1 as i32;
    let [first, second] = [bottom - 44, bottom - 20];
    let places = [(96, first), (352, first), (624, first), (96, second), (624, second)];
    let curves = curves.iter().filter(|(_, points)| !points.is_empty()).map(|(curve, _)| *curve);
    for (curve, (x, y)) in curves.zip(places) {
        if curve != Curve::Defaults {
            let line = vec![(x, y), (x + 36, y)];
            root.draw(&PathElement::new(line, colour(curve).stroke_width(width(curve))))?;
        }
        mark(root, curve, (x + 18, y))?;
        write(root, curve.title(), (x + 46, y), 17.0, TEXT, HPos::Left)?;
    }
    Ok(())
}

fn write(
    root: &Area<'_>,
    text: &str,
    place: Pixel,
    size: f64,
    colour: RGBColor,
    side: HPos,
) -> Result<(), PlotError> {
    let font = ("sans-serif", size).into_font().color(&colour).pos(Pos::new(side, VPos::Center));
    root.draw(&Text::new(text.to_owned(), place, font))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::test_measurements::{circumstances, measurement, power_laws};
    use super::*;

    /// Corners of the polylines with this curve's colour.
    fn polylines(svg: &str, curve: Curve) -> Vec<usize> {
        let RGBColor(r, g, b) = colour(curve);
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\"");
        let lines = svg.split("<polyline").skip(1).filter_map(|rest| rest.split("/>").next());
        lines
            .filter(|line| line.contains(&stroke))
            .map(|line| {
                line.split("points=\"").nth(1).unwrap().split('"').next().unwrap().split_whitespace().count()
            })
            .collect()
    }

    #[test]
    fn every_curve_is_one_line_with_a_corner_a_point() {
        let mut runs = power_laws();
        runs.insert(1, measurement(Curve::Together, Some(0.05), 4.0, 0.05));
        let text = svg(&circumstances(), &runs).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{text}");
        // The curve in both panels, and its stroke in the legend.
        assert_eq!(polylines(&text, Curve::Together), [3, 3, 2]);
        for curve in [Curve::Depth, Curve::Threshold, Curve::Rays] {
            assert_eq!(polylines(&text, curve), [2, 2, 2], "{curve:?}");
        }
        for word in ["room.glb: error over time", "Some Processor", "2 threads", "median of 5 runs", "FLIP"] {
            assert!(text.contains(word), "{word}");
        }
        // Without pictures it is lower by a panel.
        runs.iter_mut().for_each(|run| run.flip = None);
        let lower = svg(&circumstances(), &runs).unwrap();
        assert_eq!(polylines(&lower, Curve::Together), [3, 2]);
        assert!(lower.contains("height=\"640\"") && !lower.contains("FLIP"), "{lower}");
        for title in Curve::ALL.map(Curve::title) {
            assert!(text.contains(title), "{title}");
        }
        for tick in ["1 %", "2 %", "3 %", "5 %", "10 %", "1 s", "2 s", "10 s"] {
            assert!(text.lines().any(|line| line.trim() == tick), "{tick}");
        }
    }

    /// log(16) to the right, log(16^exponent) down: the slopes of the lines are as the exponents.
    #[test]
    fn axes_are_logarithmic() {
        let text = svg(&circumstances(), &power_laws()).unwrap();
        let corners = |curve: Curve| -> Vec<(f64, f64)> {
            let RGBColor(r, g, b) = colour(curve);
            let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\"");
            let line = text.split("<polyline").find(|line| line.contains(&stroke)).unwrap();
            let corners = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            corners
                .split_whitespace()
                .map(|corner| {
                    corner.split_once(',').map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).unwrap()
                })
                .collect()
        };
        let fall = |curve| {
            let corners = corners(curve);
            (corners[1].1 - corners[0].1) / (corners[1].0 - corners[0].0)
        };
        for (curve, exponent) in [(Curve::Depth, 0.75), (Curve::Threshold, 0.5), (Curve::Rays, 0.25)] {
            let ratio: f64 = fall(curve) / fall(Curve::Together);
            // Corners stand at whole pixels.
            assert!((ratio - exponent).abs() < 0.01, "{curve:?}: {ratio}");
        }
    }

    #[test]
    fn gridlines_stand_at_round_numbers() {
        assert_eq!(ticks(&(0.009..=0.12)), [0.01, 0.02, 0.03, 0.05, 0.1]);
        assert_eq!(ticks(&(1e-5..=0.5)), [1e-5, 1e-4, 1e-3, 0.01, 0.1]);
        assert_eq!(short(0.03 * 100.0), "3");
        assert_eq!(short(20.0), "20");
    }

    #[test]
    fn nothing_to_show_and_errors_of_zero_give_a_plot_too() {
        for runs in [
            vec![],
            vec![measurement(Curve::Depth, Some(0.1), 1.0, f64::NAN)],
            vec![
                measurement(Curve::Depth, Some(0.1), 1.0, 0.0),
                measurement(Curve::Depth, Some(0.01), 1.0, 0.0),
            ],
        ] {
            let text = svg(&circumstances(), &runs).unwrap();
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        }
    }
}
