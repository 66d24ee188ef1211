//! Plots of a run as SVG: a timeline of its steps and events, and lines over simulated time.

use crate::journal::{Event, Sample};
use crate::picture::escape;
use crate::summary::{StepOutcome, StepSummary};
use std::fmt::Write;

/// Size of a plot in units of its picture.
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 170.0;
/// Room for the numbers at the left, right, top and bottom edge.
const LEFT: f64 = 72.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 30.0;
/// Samples farther apart than this are not joined, seconds.
const GAP_S: f64 = 0.35;

/// One line of a plot.
pub struct Curve<'a> {
    /// What it shows, with its unit.
    pub name: &'a str,
    /// Colour as CSS understands it.
    pub color: &'a str,
    /// Its value in a sample, if it has one there.
    pub value: fn(&Sample) -> Option<f64>,
}

/// Lines over time from 0 to `end_s`, above zero. `None` when no sample has a value.
pub fn lines_svg(samples: &[Sample], end_s: f64, curves: &[Curve<'_>]) -> Option<String> {
    let values = |curve: &Curve<'_>| -> Vec<(f64, f64)> {
        let value = curve.value;
        samples.iter().filter_map(|s| Some((s.stamp.as_s(), value(s)?))).filter(|(_, v)| v.is_finite()).collect()
    };
    let all: Vec<Vec<(f64, f64)>> = curves.iter().map(values).collect();
    let top = all.iter().flatten().map(|(_, v)| *v).fold(0.0_f64, f64::max);
    if all.iter().all(Vec::is_empty) {
        return None;
    }
    let (step, end_s) = (tick_step(top.max(1e-3)), end_s.max(1e-3));
    let high = (top / step).ceil().max(1.0) * step;
    let x = |at_s: f64| LEFT + at_s / end_s * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| HEIGHT - BOTTOM - value.clamp(0.0, high) / high * (HEIGHT - TOP - BOTTOM);
    let mut svg = open(HEIGHT, curves.first().map_or("", |curve| curve.name));
    let rows = (high / step).round() as usize;
    for i in 0..=rows {
        let value = i as f64 * step;
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {0:.1}H{1}\"/><text x=\"{2}\" y=\"{3:.1}\" text-anchor=\"end\">{value:.4$}</text>",
            y(value),
            WIDTH - RIGHT,
            LEFT - 6.0,
            y(value) + 4.0,
            digits(step)
        );
    }
    write_seconds(&mut svg, end_s, HEIGHT, &x);
    for (curve, values) in curves.iter().zip(&all) {
        let mut path = String::new();
        let mut last_s = f64::NEG_INFINITY;
        for (at_s, value) in values {
            let letter = if at_s - last_s > GAP_S { 'M' } else { 'L' };
            let _ = write!(path, "{letter}{:.1} {:.1}", x(*at_s), y(*value));
            last_s = *at_s;
        }
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>", curve.color);
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// Steps as bars coloured by their outcome, with events as ticks that tell what happened when pointed at.
pub fn timeline_svg(steps: &[StepSummary], events: &[Event], end_s: f64) -> String {
    const ROW: f64 = 26.0;
    let height = TOP + ROW * (steps.len().max(1) as f64) + 22.0 + BOTTOM;
    let end_s = end_s.max(1e-3);
    let x = |at_s: f64| LEFT + at_s / end_s * (WIDTH - LEFT - RIGHT);
    let mut svg = open(height, "Timeline");
    for (row, step) in steps.iter().enumerate() {
        let color = match step.outcome {
            StepOutcome::Done => "#17693a",
            StepOutcome::Failed => "#b3261e",
            StepOutcome::Absent | StepOutcome::Ambiguous | StepOutcome::Skipped => "#8a5a00",
        };
        let (y, width) = (TOP + ROW * row as f64, (x(step.duration_s) - LEFT).max(2.0));
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">step {}</text><rect x=\"{:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" \
             height=\"{}\" rx=\"3\" fill=\"{color}\"><title>{}: {}</title></rect>",
            LEFT - 6.0,
            y + 15.0,
            step.index,
            x(step.start_s),
            ROW - 6.0,
            escape(&step.command),
            escape(&step.reason)
        );
    }
    let y = TOP + ROW * steps.len().max(1) as f64;
    let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">events</text>", LEFT - 6.0, y + 13.0);
    for event in events {
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {y:.1}v16\" stroke=\"#1e6ed2\" stroke-width=\"3\"><title>{:.1} s: {}</title></path>",
            x(event.at_s),
            event.at_s,
            escape(&event.what)
        );
    }
    write_seconds(&mut svg, end_s, height, &x);
    svg.push_str("</svg>\n");
    svg
}

fn open(height: f64, name: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{}\">\n",
        escape(name)
    )
}

fn write_seconds(svg: &mut String, end_s: f64, height: f64, x: &dyn Fn(f64) -> f64) {
    let step = tick_step(end_s * 0.6);
    let mut at_s = 0.0;
    while at_s <= end_s {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{at_s:.2$} s</text>",
            x(at_s),
            height - 10.0,
            digits(step)
        );
        at_s += step;
    }
}

/// A round distance between about four marks: 1, 2 or 5 times a power of ten.
fn tick_step(range: f64) -> f64 {
    let rough = range / 4.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let times = [1.0, 2.0, 5.0, 10.0].into_iter().find(|t| t * power >= rough * 0.999).unwrap_or(10.0);
    times * power
}

fn digits(step: f64) -> usize {
    (-step.log10().floor()).clamp(0.0, 4.0) as usize
}

#[cfg(test)]
mod tests {
    //! Contract: every value lies inside the picture, a gap in time is a gap in the line, and names stay text.
    use super::*;

    const SPEED: Curve<'_> = Curve { name: "speed", color: "#000", value: |s| Some(s.speed_m_per_s) };

    fn sample(at_s: f64, speed_m_per_s: f64) -> Sample {
        Sample { stamp: dsm::time::Stamp::from_s(at_s), speed_m_per_s, ..Sample::default() }
    }

    #[test]
    fn marks_are_round() {
        for (range, step) in [(1.0, 0.5), (0.08, 0.02), (62.0, 20.0), (4.0, 1.0)] {
            assert!((tick_step(range) - step).abs() < 1e-9, "{range} gives {}", tick_step(range));
        }
        assert_eq!((digits(0.02), digits(0.5), digits(20.0)), (2, 1, 0));
    }

    #[test]
    fn a_gap_in_time_is_a_gap_in_the_line() {
        let samples = [sample(0.1, 0.2), sample(0.2, 0.4), sample(2.0, 0.1), sample(2.1, f64::NAN)];
        let svg = lines_svg(&samples, 3.0, &[SPEED]).expect("there are values");
        let line = svg.split("<path d=\"").nth(1).expect("a line").split('"').next().expect("its path");
        assert_eq!((line.matches('M').count(), line.matches('L').count()), (2, 1), "{line}");
        for pair in line.split(['M', 'L']).skip(1) {
            let numbers: Vec<f64> = pair.split(' ').map(|n| n.parse().expect("a number")).collect();
            assert!((LEFT..=WIDTH - RIGHT).contains(&numbers[0]) && (TOP..=HEIGHT - BOTTOM).contains(&numbers[1]));
        }
        assert!(lines_svg(&[], 3.0, &[SPEED]).is_none());
    }

    #[test]
    fn names_stay_text() {
        let event = Event { at_s: 1.0, what: "<b>".into() };
        let svg = timeline_svg(&[], &[event], 2.0);
        assert!(svg.contains("&lt;b&gt;") && !svg.contains("<b>"));
    }
}
