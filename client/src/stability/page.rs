//! The table as a page.

use std::fmt::Write;

use maud::{Markup, PreEscaped, html};

use super::{ALGORITHMS, Algorithm, Naive, Row, Table, table::short};
use crate::report::{Align, Cell, Page, Section, Table as PageTable, Tone};

/// Contrasts that the first section shows: the plainest of every algorithm.
const CONTRASTS_EACH: usize = 4;

/// The page; `command` makes it again, `facts` are what it hangs on.
#[must_use]
pub fn page(table: &Table, command: String, facts: Vec<(String, String)>) -> Page {
    let missed = table.missed().count();
    let tone = if missed == 0 { Tone::Good } else { Tone::Bad };
    let algorithms = ALGORITHMS.iter().filter(|a| table.of(a.name).next().is_some());
    let plain = table.rows.iter().filter(|row| row.naive.iter().any(|naive| naive.fails)).count();
    let tiles = vec![
        (table.rows.len().to_string(), "cases".into(), Tone::Plain),
        (algorithms.clone().count().to_string(), "algorithms".into(), Tone::Plain),
        ((table.rows.len() - missed).to_string(), "within their tolerance".into(), tone),
        (missed.to_string(), "beyond it".into(), if missed == 0 { Tone::Plain } else { Tone::Bad }),
        (plain.to_string(), "where a usual shortcut plainly fails".into(), Tone::Warn),
    ];
    let mut sections = Vec::new();
    if missed > 0 {
        sections.push(Section {
            anchor: "missed".into(),
            title: "Beyond their tolerance".into(),
            lead: "What does not hold.".into(),
            body: rows(table.missed()),
        });
    }
    sections.push(overview(table));
    if plain > 0 {
        sections.push(contrasts(table));
    }
    sections.extend(algorithms.map(|algorithm| section(algorithm, table)));
    Page {
        title: "Numerical stability".into(),
        summary: format!("{}.", table.summary()),
        facts,
        command,
        tiles,
        sections,
    }
}

fn section(algorithm: &Algorithm, table: &Table) -> Section {
    Section {
        anchor: algorithm.name.replace(' ', "-"),
        title: title(algorithm.name),
        lead: algorithm.about.into(),
        body: rows(table.of(algorithm.name)),
    }
}

fn title(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Where shortcuts fail while ours hold: of every algorithm the plainest.
fn contrasts(table: &Table) -> Section {
    let mut shown = PageTable::new(&[
        ("case", Align::Text),
        ("algorithm", Align::Word),
        ("here", Align::Number),
        ("shortcut", Align::Text),
        ("its error", Align::Number),
        ("unit", Align::Word),
    ]);
    for algorithm in &ALGORITHMS {
        let mut failing: Vec<_> =
            table.failing_shortcuts().filter(|(row, _)| row.algorithm == algorithm.name).collect();
        let beyond = |error: f64, tolerance: f64| {
            let error = if error.is_nan() { f64::INFINITY } else { error };
            error / tolerance.max(f64::MIN_POSITIVE)
        };
        failing.sort_by(|(a, x), (b, y)| {
            beyond(y.error, b.tolerance).total_cmp(&beyond(x.error, a.tolerance))
        });
        for (row, naive) in plainest(&failing) {
            shown.rows.push(vec![
                Cell::Markup(powers(&row.case)),
                algorithm.name.into(),
                Cell::Markup(figure(row.error)),
                naive.name.into(),
                Cell::Markup(html! { span.bad-number { (figure(naive.error)) } }),
                Cell::Markup(html! { span.unit { (row.unit) } }),
            ]);
        }
    }
    Section {
        anchor: "contrasts".into(),
        title: "Where the usual way fails".into(),
        lead: "The same cases by the shortcuts that programs take, worst first; none: there is no \
               result, or no number. All others stand with their algorithms below."
            .into(),
        body: shown.markup(),
    }
}

/// Some of those that fail, worst first: each of another case, and each shortcut once before any twice.
fn plainest<'a>(failing: &[(&'a Row, &'a Naive)]) -> Vec<(&'a Row, &'a Naive)> {
    let mut chosen: Vec<(&Row, &Naive)> = Vec::new();
    for may_repeat in [false, true] {
        for &(row, naive) in failing {
            let is_new = chosen.iter().all(|(other, _)| other.case != row.case);
            let repeats = chosen.iter().any(|(_, other)| other.name == naive.name);
            if chosen.len() < CONTRASTS_EACH && is_new && (may_repeat || !repeats) {
                chosen.push((row, naive));
            }
        }
    }
    chosen
}

fn rows<'a>(rows: impl Iterator<Item = &'a Row>) -> Markup {
    let mut table = PageTable::new(&[
        ("case", Align::Text),
        ("error", Align::Number),
        ("tolerance", Align::Number),
        ("", Align::Word),
        ("by usual shortcuts", Align::Text),
        ("why this tolerance; measured against", Align::Fine),
    ]);
    for row in rows {
        let tone = if row.passed { Tone::Good } else { Tone::Bad };
        let verdict = if row.passed { "holds" } else { "missed" };
        table.rows.push(vec![
            Cell::Markup(powers(&row.case)),
            Cell::Markup(html! {
                @if row.passed { (figure(row.error)) }
                @else { span.bad-number { (figure(row.error)) } }
                div.unit { (row.unit) }
            }),
            Cell::Markup(figure(row.tolerance)),
            Cell::Chip(verdict.into(), tone),
            Cell::Markup(shortcuts(row)),
            Cell::Markup(html! { (row.reason) "; against " (row.reference) }),
        ]);
    }
    table.markup()
}

fn shortcuts(row: &Row) -> Markup {
    html! {
        @for naive in &row.naive {
            div.beside {
                span.unit { (naive.name) } " "
                @if naive.fails { span.bad-number.figure { (figure(naive.error)) } }
                @else { span.figure { (figure(naive.error)) } }
            }
        }
    }
}

/// A number in two digits, its power of ten raised; `none` where it is no number.
fn figure(value: f64) -> Markup {
    let text = short(value);
    match text.split_once('e').filter(|_| value.is_finite()) {
        Some((digits, power)) => html! { (digits) " · 10" sup { (minus(power)) } },
        None => html! { (text) },
    }
}

/// A case's name, its powers raised.
fn powers(name: &str) -> Markup {
    let mut parts = name.split('^');
    let first = parts.next().unwrap_or_default();
    html! {
        (first)
        @for part in parts {
            @let end = part.find(|c: char| !(c == '-' || c.is_ascii_digit())).unwrap_or(part.len());
            sup { (minus(&part[..end])) } (part[end..])
        }
    }
}

/// With the sign that figures have.
fn minus(power: &str) -> String {
    power.replace('-', "\u{2212}")
}

/// Decades of error, in tolerances, that the drawing shows.
const DECADES: std::ops::RangeInclusive<i32> = -4..=16;

/// One row of dots per algorithm: how many tolerances each error is.
fn overview(table: &Table) -> Section {
    let rows: Vec<&Algorithm> =
        ALGORITHMS.iter().filter(|a| table.of(a.name).next().is_some()).collect();
    let (left, right, row_height, top) = (104.0, 900.0, 30.0, 14.0);
    let height = top + row_height * rows.len() as f64 + 30.0;
    let (first, last) = (f64::from(*DECADES.start()), f64::from(*DECADES.end()));
    // No error at all is left of the axis, no result right of it.
    let at = |error: f64, tolerance: f64| {
        let decades = if error == 0.0 {
            first - 1.0
        } else if !error.is_finite() || tolerance == 0.0 {
            last + 1.0
        } else {
            (error / tolerance).log10().clamp(first, last)
        };
        left + (decades - first + 1.5) / (last - first + 3.0) * (right - left)
    };
    let limit = at(1.0, 1.0);
    let mut svg = String::new();
    // A write to a string does not fail.
    let _ = write!(
        svg,
        "<svg viewBox=\"0 0 {} {height}\" role=\"img\" aria-label=\"Errors in tolerances\" \
         class=\"strip\">",
        right + 16.0
    );
    let bottom = height - 30.0;
    let _ = write!(
        svg,
        "<rect x=\"{left}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"inside\"/>",
        top - 8.0,
        limit - left,
        bottom - top + 12.0
    );
    for decade in DECADES.step_by(4) {
        let x = at(10f64.powi(decade), 1.0);
        let label = if decade == 0 { "tolerance".into() } else { superscript(decade) };
        let class = if decade == 0 { "limit" } else { "tick" };
        let _ = write!(
            svg,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{}\" y2=\"{}\" class=\"{class}\"/><text \
             x=\"{x:.1}\" y=\"{}\" class=\"label\">{label}</text>",
            top - 8.0,
            bottom + 4.0,
            bottom + 22.0
        );
    }
    for (x, label) in [(at(0.0, 1.0), "exact"), (at(f64::NAN, 1.0), "none")] {
        let y = bottom + 22.0;
        let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{y}\" class=\"label\">{label}</text>");
    }
    for (i, algorithm) in rows.iter().enumerate() {
        let y = top + row_height * (i as f64 + 0.5);
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" class=\"name\">{}</text>",
            left - 14.0,
            y + 4.0,
            algorithm.name
        );
        for row in table.of(algorithm.name) {
            for naive in &row.naive {
                dot(&mut svg, at(naive.error, row.tolerance), y + 5.0, "shortcut");
            }
        }
        for row in table.of(algorithm.name) {
            dot(
                &mut svg,
                at(row.error, row.tolerance),
                y - 5.0,
                if row.passed { "ours" } else { "miss" },
            );
        }
    }
    svg += "</svg>";
    Section {
        anchor: "overview".into(),
        title: "All errors at a glance".into(),
        lead: "A dot per case, by how many tolerances its error is, on a scale of powers of ten: \
               above the line of each algorithm its own, below it those of the usual shortcuts."
            .into(),
        body: html! {
            figure.plot {
                div.scroll { (PreEscaped(svg)) }
                figcaption {
                    span.key.ours {} "lodestream"
                    span.key.shortcut {} "usual shortcuts"
                    @if table.missed().next().is_some() { span.key.miss {} "missed" }
                }
            }
        },
    }
}

fn dot(svg: &mut String, x: f64, y: f64, class: &str) {
    let radius = if class == "miss" { 5.2 } else { 3.6 };
    let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" class=\"{class}\"/>");
}

/// Ten to a power, for a drawing.
fn superscript(power: i32) -> String {
    format!("10<tspan dy=\"-5\" font-size=\"9\">{power}</tspan>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_on_the_page_and_a_miss_comes_first() {
        let mut held =
            Row::new("held case", (1e-17, "m"), (1e-15, "because"), "exact").beside("usual", 1.0);
        held.algorithm = "eigen";
        let mut missed = Row::holds("missed case", false, "because", "exact");
        missed.algorithm = "plane";
        let table = Table { rows: vec![held, missed] };
        let html = page(&table, "lodestream stability -o DIR".into(), Vec::new()).render();
        assert_eq!(powers("10^-6 : 1").into_string(), "10<sup>\u{2212}6</sup> : 1");
        assert_eq!(figure(f64::NAN).into_string(), "none");
        assert_eq!(figure(1.2e-9).into_string(), "1.2 · 10<sup>\u{2212}9</sup>");
        let place = |text: &str| html.find(text).unwrap_or_else(|| panic!("{text} in {html}"));
        assert!(place("id=\"missed\"") < place("id=\"overview\""));
        assert!(place("id=\"overview\"") < place("id=\"contrasts\""));
        assert!(place("id=\"contrasts\"") < place("id=\"eigen\""));
        assert!(place("held case") < place("id=\"plane\""));
    }
}
