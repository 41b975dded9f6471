//! Curves and dots as SVG, inside a page.
//!
//! Not by a plotting library: those that draw SVG fix colours and fonts when they draw, and a page
//! that is read in light and dark takes both from its style sheet.

use maud::{Markup, html};

/// A line, or dots.
#[derive(Debug, Clone)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Which of the page's colours, from 1.
    pub color: usize,
    /// From left to right where they are joined.
    pub points: Vec<(f64, f64)>,
    /// How they are shown.
    pub mark: Mark,
}

/// How points are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Each stays until the next: what is known only at steps.
    Steps,
    /// Joined by straight lines, with a dot on each.
    Line,
    /// A ring around each: what stands out.
    Rings,
}

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By powers of ten.
    Logarithmic,
}

/// A drawing with two axes.
#[derive(Debug, Clone)]
pub struct Plot {
    /// What it shows.
    pub title: String,
    /// What is told to the right, with its unit.
    pub x: String,
    /// What is told upwards, with its unit.
    pub y: String,
    /// How x is divided.
    pub x_scale: Scale,
    /// Lowest and highest y; by the points where there is none.
    pub y_range: Option<(f64, f64)>,
    /// Lines across, by value: levels to reach.
    pub levels: Vec<f64>,
    /// Lines down, by value and name.
    pub marks: Vec<(f64, String)>,
    /// What is shown.
    pub series: Vec<Series>,
}

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 320.0;
const LEFT: f64 = 60.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 44.0;

impl Plot {
    /// The drawing with its title and legend.
    #[must_use]
    pub fn markup(&self) -> Markup {
        let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let points: Vec<_> =
            self.series.iter().flat_map(|s| s.points.iter().filter(finite)).collect();
        let x = Axis::of(points.iter().map(|p| p.0), self.x_scale, None);
        let y = Axis::of(points.iter().map(|p| p.1), Scale::Linear, self.y_range);
        let place_x = |value: f64| LEFT + x.share(value) * (WIDTH - LEFT - RIGHT);
        let place_y = |value: f64| HEIGHT - BOTTOM - y.share(value) * (HEIGHT - TOP - BOTTOM);
        let low = HEIGHT - BOTTOM;
        html! {
            figure.plot {
                figcaption { (self.title) }
                svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(self.title) {
                    @for tick in y.ticks() {
                        line.grid x1=(LEFT) x2=(WIDTH - RIGHT) y1=(place_y(tick)) y2=(place_y(tick)) {}
                        text x=(LEFT - 7.0) y=(place_y(tick) + 4.0) text-anchor="end" { (short(tick)) }
                    }
                    @for tick in x.ticks() {
                        line.grid x1=(place_x(tick)) x2=(place_x(tick)) y1=(TOP) y2=(low) {}
                        text x=(place_x(tick)) y=(low + 17.0) text-anchor="middle" { (short(tick)) }
                    }
                    @for &level in &self.levels {
                        line.level x1=(LEFT) x2=(WIDTH - RIGHT) y1=(place_y(level)) y2=(place_y(level)) {}
                    }
                    @for (at, name) in &self.marks {
                        line.level x1=(place_x(*at)) x2=(place_x(*at)) y1=(TOP) y2=(low) {}
                        text.note x=(place_x(*at) - 4.0) y=(TOP + 10.0) text-anchor="end" { (name) }
                    }
                    text.axis x=((LEFT + WIDTH - RIGHT) / 2.0) y=(HEIGHT - 6.0) text-anchor="middle" { (self.x) }
                    text.axis x="13" y=((TOP + low) / 2.0) text-anchor="middle"
                        transform={ "rotate(-90 13 " ((TOP + low) / 2.0) ")" } { (self.y) }
                    @for series in &self.series {
                        (curve(series, &place_x, &place_y))
                    }
                }
                ul.legend {
                    @for series in &self.series {
                        li { i style={ "background: " (color(series.color)) } {} (series.name) }
                    }
                }
            }
        }
    }
}

fn curve(series: &Series, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) -> Markup {
    let finite = series.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
    let places: Vec<_> = finite.map(|p| (x(p.0), y(p.1))).collect();
    let mut path = String::new();
    for (index, &(px, py)) in places.iter().enumerate() {
        path.push_str(&match (index, series.mark) {
            (0, _) => format!("M{px:.1} {py:.1}"),
            (_, Mark::Steps) => format!("H{px:.1}V{py:.1}"),
            (_, Mark::Line | Mark::Rings) => format!("L{px:.1} {py:.1}"),
        });
    }
    let color = color(series.color);
    html! {
        @if series.mark != Mark::Rings {
            path.curve d=(path) style={ "stroke: " (color) } {}
        }
        @if series.mark == Mark::Line {
            @for (px, py) in &places { circle cx=(format!("{px:.1}")) cy=(format!("{py:.1}")) r="2.6" style={ "fill: " (color) } {} }
        }
        @if series.mark == Mark::Rings {
            @for (px, py) in &places { circle.ring cx=(format!("{px:.1}")) cy=(format!("{py:.1}")) r="5.5" style={ "stroke: " (color) } {} }
        }
    }
}

fn color(number: usize) -> String {
    format!("var(--series-{})", (number.max(1) - 1) % 8 + 1)
}

struct Axis {
    low: f64,
    high: f64,
    scale: Scale,
}

impl Axis {
    fn of(values: impl Iterator<Item = f64>, scale: Scale, range: Option<(f64, f64)>) -> Self {
        let usable = values.filter(|v| scale == Scale::Linear || *v > 0.0);
        let found = usable
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = range.unwrap_or(found);
        let (low, high) = match scale {
            _ if !(low.is_finite() && high.is_finite()) => (0.0, 1.0),
            Scale::Logarithmic => (low.log10(), high.log10()),
            // Times and bytes begin at 0.
            Scale::Linear if range.is_none() => (low.min(0.0), high),
            Scale::Linear => (low, high),
        };
        let high = if high > low { high } else { low + 1.0 };
        Self { low, high, scale }
    }

    /// Where a value lies, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        let value = if self.scale == Scale::Logarithmic { value.log10() } else { value };
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    fn ticks(&self) -> Vec<f64> {
        match self.scale {
            Scale::Linear => even_ticks(self.low, self.high),
            // As few as tell the scale.
            Scale::Logarithmic => [&[1.0][..], &[1.0, 2.0, 5.0]]
                .into_iter()
                .map(|mantissas| self.power_ticks(mantissas))
                .find(|ticks| ticks.len() >= 3)
                .unwrap_or_else(|| even_ticks(10_f64.powf(self.low), 10_f64.powf(self.high))),
        }
    }

    /// Powers of ten times each of `mantissas`.
    fn power_ticks(&self, mantissas: &[f64]) -> Vec<f64> {
        let powers = (0..40).map(|power| 10_f64.powf(self.low.floor() + f64::from(power)));
        let ticks = powers.flat_map(|power| mantissas.iter().map(move |m| m * power));
        let inside = |tick: &f64| (self.low - 1e-9..=self.high + 1e-9).contains(&tick.log10());
        ticks.filter(inside).collect()
    }
}

/// Some five round numbers.
fn even_ticks(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 5.0;
    let unit = 10_f64.powf(rough.log10().floor());
    let times = [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().find(|t| t * unit >= rough);
    let step = times.unwrap_or(10.0) * unit;
    let first = (low / step).ceil();
    let ticks = (0..40).map(|i| (first + f64::from(i)) * step);
    ticks.take_while(|tick| *tick <= high + 1e-9 * step).collect()
}

/// As short as it can be told: `0.95`, `1.5k`, `20M`.
fn short(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        v if v >= 1e9 => (value / 1e9, "G"),
        v if v >= 1e6 => (value / 1e6, "M"),
        v if v >= 1e4 => (value / 1e3, "k"),
        _ => (value, ""),
    };
    // Without the noise of binary fractions.
    let rounded = (scaled * 1e4).round() / 1e4;
    format!("{rounded}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: [f64; 2], scale: Scale) -> Axis {
        Axis::of(values.into_iter(), scale, None)
    }

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        assert_eq!(
            axis([0.0, 2500.0], Scale::Linear).ticks(),
            [0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0]
        );
        let found = axis([3e4, 2e7], Scale::Logarithmic).ticks();
        assert_eq!(found, [1e5, 1e6, 1e7]);
        assert_eq!(axis([f64::NAN, f64::NAN], Scale::Linear).ticks().len(), 6);
    }

    #[test]
    fn a_logarithmic_axis_within_a_power_of_ten_has_ticks_too() {
        assert_eq!(axis([4.0, 23.0], Scale::Logarithmic).ticks(), [5.0, 10.0, 20.0]);
        assert_eq!(axis([3.0, 4.0], Scale::Logarithmic).ticks().len(), 6);
        let equal = axis([7.0, 7.0], Scale::Logarithmic).ticks();
        assert!(equal.len() >= 3 && equal.iter().all(|t| (6.9..71.0).contains(t)), "{equal:?}");
    }

    #[test]
    fn numbers_are_short() {
        let found = [0.95, 0.1 + 0.2, 500.0, 25_000.0, 5e6, 0.0].map(short);
        assert_eq!(found, ["0.95", "0.3", "500", "25k", "5M", "0"]);
    }

    #[test]
    fn every_series_is_drawn_and_named_and_what_is_no_number_is_left_out() {
        let series = |name: &str, mark| Series {
            name: name.into(),
            color: 1,
            points: vec![(0.0, 0.5), (f64::NAN, 0.6), (1.0, 0.7)],
            mark,
        };
        let plot = Plot {
            title: "a <b>".into(),
            x: "ms".into(),
            y: "SSIM".into(),
            x_scale: Scale::Linear,
            y_range: Some((0.0, 1.0)),
            levels: vec![0.95],
            marks: vec![(0.5, "bound".into())],
            series: vec![series("one", Mark::Steps), series("two", Mark::Line)],
        };
        let html = plot.markup().into_string();
        assert_eq!(html.matches("class=\"curve\"").count(), 2);
        assert!(html.contains(">one<") && html.contains(">two<") && html.contains("bound"));
        assert!(!html.contains("NaN") && html.contains("a &lt;b&gt;"), "{html}");
    }
}
