//! One self-contained HTML page: the frame that all reports share.
//!
//! A page is one file that opens anywhere and in twenty years: the style sheet is inside, nothing is
//! loaded from elsewhere, and there are no scripts. It is readable in light and dark surroundings and
//! on a telephone. What a report shows in its sections (tables, drawings in SVG, pictures as data
//! URLs) is its own affair; colours come from the style sheet's variables, `var(--series-1)` to
//! `var(--series-8)` for curves.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The style sheet.
const STYLE: &str = include_str!("page.css");

/// A page.
#[derive(Debug, Clone)]
pub struct Page {
    /// What it is about, in a few words.
    pub title: String,
    /// The one line that a hurried reader takes home.
    pub summary: String,
    /// What the figures hang on: machine, versions, seed, input. Name and value.
    pub facts: Vec<(String, String)>,
    /// The command that makes this page again.
    pub command: String,
    /// The most important numbers, shown large. Value, what it is, and how good that is.
    pub tiles: Vec<(String, String, Tone)>,
    /// In order.
    pub sections: Vec<Section>,
}

/// A part of a page with a heading, which can be linked to.
#[derive(Debug, Clone)]
pub struct Section {
    /// Unique on the page; letters, digits and hyphens.
    pub anchor: String,
    /// The heading.
    pub title: String,
    /// One or two sentences below the heading; may be empty.
    pub lead: String,
    /// What follows.
    pub body: Markup,
}

/// How good something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// Neither good nor bad.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// To be looked at.
    Warn,
    /// Not as it should be.
    Bad,
}

impl Tone {
    const fn class(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Good => "good",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }
}

/// How a column is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Text that wraps.
    Text,
    /// Text that stays on one line.
    Word,
    /// Numbers, to the right, all digits equally wide.
    Number,
    /// Long text in small print.
    Fine,
}

impl Align {
    const fn class(self) -> &'static str {
        match self {
            Self::Text => "",
            Self::Word => "word",
            Self::Number => "num",
            Self::Fine => "fine",
        }
    }
}

/// What stands in one place of a table.
#[derive(Debug, Clone)]
pub enum Cell {
    /// As it is.
    Text(String),
    /// As it is, coloured.
    Toned(String, Tone),
    /// Set off as a label.
    Chip(String, Tone),
    /// Anything else.
    Markup(Markup),
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// A table. The first column names the row and stays in sight on narrow screens.
#[derive(Debug, Clone)]
pub struct Table {
    /// Headings, and how their columns are set.
    pub columns: Vec<(String, Align)>,
    /// Row by row, as many cells as columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table.
    #[must_use]
    pub fn new(columns: &[(&str, Align)]) -> Self {
        let columns = columns.iter().map(|&(name, align)| (name.to_owned(), align)).collect();
        Self { columns, rows: Vec::new() }
    }

    /// The table as HTML.
    #[must_use]
    pub fn markup(&self) -> Markup {
        html! {
            // Can be scrolled sideways by keyboard, too.
            div.table tabindex="0" {
                table {
                    thead { tr {
                        @for (name, align) in &self.columns { th class=[class(*align)] scope="col" { (name) } }
                    } }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (index, (cell, (_, align))) in row.iter().zip(&self.columns).enumerate() {
                                    @if index == 0 {
                                        th class=[class(*align)] scope="row" { (cell_markup(cell)) }
                                    } @else {
                                        td class=[class(*align)] { (cell_markup(cell)) }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn class(align: Align) -> Option<&'static str> {
    Some(align.class()).filter(|class| !class.is_empty())
}

fn cell_markup(cell: &Cell) -> Markup {
    match cell {
        Cell::Text(text) | Cell::Toned(text, Tone::Plain | Tone::Good) => html! { (text) },
        Cell::Toned(text, Tone::Warn | Tone::Bad) => html! { span.bad-number { (text) } },
        Cell::Chip(text, tone) => html! { span class={ "chip " (tone.class()) } { (text) } },
        Cell::Markup(markup) => markup.clone(),
    }
}

impl Page {
    /// The whole file.
    #[must_use]
    pub fn render(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) " · lodestream" }
                    style { (PreEscaped(STYLE)) }
                }
                body { div.sheet {
                    (self.header())
                    main {
                        @if !self.tiles.is_empty() {
                            div.tiles {
                                @for (value, what, tone) in &self.tiles {
                                    div class={ "tile " (tone.class()) } { b { (value) } span { (what) } }
                                }
                            }
                        }
                        @for section in &self.sections {
                            section id=(section.anchor) {
                                h2 { a href={ "#" (section.anchor) } { (section.title) } }
                                @if !section.lead.is_empty() { p.lead { (section.lead) } }
                                (section.body)
                            }
                        }
                    }
                    footer { "lodestream " (env!("CARGO_PKG_VERSION")) " · one file, nothing loaded from elsewhere" }
                } }
            }
        };
        page.into_string()
    }

    fn header(&self) -> Markup {
        html! {
            header.title {
                p.mark { (mark()) "lodestream" }
                h1 { (self.title) }
                p.summary { (self.summary) }
                dl.facts {
                    @for (name, value) in &self.facts { div { dt { (name) } dd { (value) } } }
                }
                code.command tabindex="0" { (self.command) }
                @if self.sections.len() > 1 {
                    nav.contents aria-label="Contents" { ul {
                        @for section in &self.sections {
                            li { a href={ "#" (section.anchor) } { (section.title) } }
                        }
                    } }
                }
            }
        }
    }
}

/// Points that grow finer, level by level.
fn mark() -> Markup {
    const LEVELS: [(f64, f64, &[f64]); 4] = [
        (3.2, 2.6, &[11.0]),
        (9.6, 1.9, &[6.2, 15.8]),
        (15.0, 1.3, &[3.2, 8.4, 13.6, 18.8]),
        (19.6, 0.8, &[1.4, 4.1, 6.9, 9.6, 12.4, 15.1, 17.9, 20.6]),
    ];
    html! {
        svg viewBox="0 0 22 22" aria-hidden="true" fill="currentColor" {
            @for (x, radius, rows) in LEVELS {
                @for y in rows { circle cx=(x) cy=(y) r=(radius) {} }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Page {
        let mut table = Table::new(&[("case", Align::Word), ("error", Align::Number)]);
        table.rows.push(vec!["<needle>".into(), Cell::Toned("1e-16".into(), Tone::Bad)]);
        Page {
            title: "A & B".into(),
            summary: "All is well.".into(),
            facts: vec![("machine".into(), "two cores".into())],
            command: "lodestream stability -o \"out\"".into(),
            tiles: vec![("12".into(), "cases".into(), Tone::Good)],
            sections: vec![Section {
                anchor: "first".into(),
                title: "First".into(),
                lead: String::new(),
                body: table.markup(),
            }],
        }
    }

    #[test]
    fn what_a_report_says_is_escaped() {
        let html = page().render();
        assert!(html.contains("A &amp; B") && html.contains("&lt;needle&gt;"), "{html}");
        assert!(!html.contains("<needle>"));
    }

    #[test]
    fn a_page_needs_nothing_from_elsewhere_and_runs_nothing() {
        let html = page().render();
        for foreign in ["http:", "https:", "<script", "@import", "url("] {
            assert!(!html.contains(foreign), "{foreign}");
        }
        assert!(html.contains("prefers-color-scheme: dark") && html.contains("id=\"first\""));
    }
}
