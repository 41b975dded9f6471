//! The report as a page: curves first, tables behind them.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use image::{ImageFormat, RgbaImage, imageops};
use maud::{Markup, PreEscaped, html};

use super::{
    report::{Race, Report, SubjectReport},
    run::Exhibit,
    stream::LEVELS,
};
use crate::{
    engine::Policy,
    report::{Align, Cell, Mark, Page, Plot, Scale, Section, Series, Table, Tone},
};

/// Of the pictures on the page.
const EXHIBIT_WIDTH: u32 = 480;

/// The page.
#[must_use]
pub fn page(report: &Report, exhibits: &[Exhibit]) -> Page {
    let mut sections = vec![answer(report)];
    for subject in &report.subjects {
        sections.push(streams(subject));
        if !subject.paths.is_empty() {
            sections.push(paths(subject));
        }
        sections.push(frames(subject));
        sections.push(left_out(subject));
    }
    if report.subjects.iter().any(|subject| subject.build.is_some()) {
        sections.push(builds(report));
    }
    if !exhibits.is_empty() {
        sections.push(gallery(exhibits));
    }
    let [width, height] = report.size_px;
    let samples = report.samples;
    Page {
        title: "Error against run time".into(),
        summary: summary(report),
        facts: vec![
            ("machine".into(), report.machine.clone()),
            ("lodestream".into(), report.lodestream.clone()),
            ("pictures".into(), format!("{width} x {height} pixels")),
            ("truth".into(), format!("all points, {samples} x {samples} samples a pixel")),
            ("seed".into(), report.seed.to_string()),
        ],
        command: report.command.clone(),
        tiles: tiles(report),
        sections,
    }
}

/// The race that is told first: on the first link, the first view that all policies were tried on.
fn first_race(report: &Report) -> Option<(&SubjectReport, Race<'_>)> {
    let subject = report.subjects.first()?;
    let races = subject.races();
    let medium = races.iter().position(|race| race.view == "medium" && race.from == "cold");
    let race = races.into_iter().nth(medium.unwrap_or(0))?;
    Some((subject, race))
}

fn summary(report: &Report) -> String {
    let Some((subject, race)) = first_race(report) else {
        return "What each way to draw and to fetch costs, and how wrong its pictures are.".into();
    };
    let times = race.runs.iter().map(|entrant| {
        let at = entrant.run.reached.get(1).copied().flatten();
        let time = at.map_or("never".into(), |r| {
            format!("after {} and {}", seconds(r.ms), megabytes(r.bytes))
        });
        format!("{} {time}", entrant.run.policy.name())
    });
    let times: Vec<_> = times.collect();
    format!(
        "The {} view of {} over {} is 95 % right (SSIM 0.95): {}.",
        race.view,
        subject.name,
        race.link,
        times.join("; ")
    )
}

fn tiles(report: &Report) -> Vec<(String, String, Tone)> {
    let Some((_, race)) = first_race(report) else { return Vec::new() };
    let of = |policy| race.runs.iter().find(move |e| e.run.policy == policy);
    let Some(ours) = of(Policy::Ours) else { return Vec::new() };
    let mut tiles = Vec::new();
    if let Some(ms) = ours.run.settled_ms {
        let factor = ms / ours.run.bound_ms;
        let tone = if factor <= 1.25 { Tone::Good } else { Tone::Warn };
        tiles.push((
            format!("{factor:.2}x"),
            "of the least time the link allows, until all is there".into(),
            tone,
        ));
    }
    for policy in [Policy::PotreeBrotli, Policy::Potree, Policy::Fraiss] {
        let Some(rival) = of(policy) else { continue };
        let factor = rival.area / ours.area;
        let tone = if factor >= 1.0 { Tone::Good } else { Tone::Bad };
        tiles.push((
            format!("{factor:.2}x"),
            format!("the error over time with the policy {}, against ours", policy.name()),
            tone,
        ));
    }
    if let Some(saved) = ours.bytes_saved {
        let tone = if saved <= 0.0 { Tone::Good } else { Tone::Warn };
        tiles.push((percent(saved), "bytes at equal error, against potree".into(), tone));
    }
    tiles
}

fn answer(report: &Report) -> Section {
    let mut columns = vec![
        ("dataset", Align::Word),
        ("view", Align::Word),
        ("link", Align::Word),
        ("policy", Align::Word),
    ];
    let levels = LEVELS.map(|level| format!("SSIM {level}"));
    columns.extend(levels.iter().map(|level| (level.as_str(), Align::Number)));
    columns.extend([
        ("all there", Align::Number),
        ("bound", Align::Number),
        ("MB", Align::Number),
        ("requests", Align::Number),
        ("final SSIM", Align::Number),
        ("error x time", Align::Number),
        ("bytes at equal error", Align::Number),
    ]);
    let mut table = Table::new(&columns);
    for subject in &report.subjects {
        for race in subject.races() {
            let least = race.runs.iter().map(|e| e.area).fold(f64::INFINITY, f64::min);
            for entrant in &race.runs {
                let run = entrant.run;
                let view = match race.from {
                    "cold" => race.view.to_owned(),
                    from => format!("{} from {from}", race.view),
                };
                let mut row: Vec<Cell> = vec![
                    subject.name.as_str().into(),
                    view.into(),
                    race.link.into(),
                    Cell::Chip(
                        run.policy.name().into(),
                        if run.policy == Policy::Ours { Tone::Good } else { Tone::Plain },
                    ),
                ];
                row.extend((0..LEVELS.len()).map(|level| {
                    let reached = run.reached.get(level).copied().flatten();
                    reached.map_or("-".into(), |r| Cell::from(seconds(r.ms)))
                }));
                row.extend([
                    run.settled_ms.map_or("-".into(), |ms| Cell::from(seconds(ms))),
                    seconds(run.bound_ms).into(),
                    format!("{:.2}", run.bytes as f64 / 1e6).into(),
                    run.requests.to_string().into(),
                    format!("{:.4}", run.ssim).into(),
                    Cell::Toned(
                        format!("{:.3}", entrant.area),
                        if entrant.area > 1.02 * least { Tone::Plain } else { Tone::Good },
                    ),
                    entrant.bytes_saved.map_or("-".into(), |s| Cell::from(percent(s))),
                ]);
                table.rows.push(row);
            }
        }
    }
    Section {
        anchor: "answer".into(),
        title: "How long until the picture is right".into(),
        lead: "Seconds since the view was set until the picture is as similar to the truth as the \
               heading says, and stays so; “error x time” is the area between the curve and 1 until \
               the slowest is done, in seconds; “bytes at equal error” are against potree. Times are \
               those of the link: simulated, so that they repeat to the last digit. “Bound” is the \
               bytes' transmission and two round trips, one after a jump."
            .into(),
        body: table.markup(),
    }
}

fn policy_color(policy: Policy) -> usize {
    Policy::ALL.iter().position(|p| *p == policy).map_or(1, |index| index + 1)
}

fn streams(subject: &SubjectReport) -> Section {
    let plots = subject.races().into_iter().flat_map(|race| {
        let title = match race.from {
            "cold" => format!("{} view by {}", race.view, race.link),
            from => format!("{} after {from}, by {}", race.view, race.link),
        };
        let series = |x: fn(&super::Sample) -> f64| {
            let runs = race.runs.iter();
            let curve = runs.map(move |entrant| Series {
                name: entrant.run.policy.name().into(),
                color: policy_color(entrant.run.policy),
                points: entrant.run.samples.iter().map(|s| (x(s), s.ssim)).collect(),
                mark: Mark::Steps,
            });
            curve.collect::<Vec<_>>()
        };
        let bound = race.runs.iter().find(|e| e.run.policy == Policy::Ours);
        let bound = bound.map(|e| (e.run.bound_ms / 1e3, "bound".to_owned()));
        let plot = |x: &str, series, marks| Plot {
            title: title.clone(),
            x: x.into(),
            y: "SSIM".into(),
            x_scale: Scale::Linear,
            y_range: Some(range(&race)),
            levels: LEVELS.to_vec(),
            marks,
            series,
        };
        let over_time = plot("seconds", series(|s| s.ms / 1e3), bound.into_iter().collect());
        let over_bytes = plot("megabytes", series(|s| s.bytes as f64 / 1e6), Vec::new());
        [over_time.markup(), over_bytes.markup()]
    });
    Section {
        anchor: format!("{}-stream", anchor(&subject.name)),
        title: format!("{}: streaming in", subject.name),
        lead: "Similarity to the truth while the view streams in, over time and over bytes. What has \
               come is drawn as finely sampled as the truth, so that what is missing is what has not \
               come."
            .into(),
        body: html! { div.plots { @for plot in plots { (plot) } } },
    }
}

fn paths(subject: &SubjectReport) -> Section {
    let mut table = Table::new(&[
        ("path", Align::Word),
        ("link", Align::Word),
        ("policy", Align::Word),
        ("mean SSIM", Align::Number),
        ("worst SSIM", Align::Number),
        ("popping", Align::Number),
        ("MB", Align::Number),
        ("requests", Align::Number),
        ("broken off", Align::Number),
    ]);
    let mut plots: Vec<Plot> = Vec::new();
    for run in &subject.paths {
        let own = run.policy == Policy::Ours;
        table.rows.push(vec![
            run.path.as_str().into(),
            run.link.as_str().into(),
            Cell::Chip(run.policy.name().into(), if own { Tone::Good } else { Tone::Plain }),
            format!("{:.4}", run.mean_ssim).into(),
            format!("{:.4}", run.worst_ssim).into(),
            run.popping_rms.map_or("-".into(), |rms| Cell::from(format!("{rms:.2}"))),
            format!("{:.2}", run.bytes as f64 / 1e6).into(),
            run.requests.to_string().into(),
            run.cancelled.to_string().into(),
        ]);
        let series = Series {
            name: run.policy.name().into(),
            color: policy_color(run.policy),
            points: run.samples.iter().map(|s| (s.seconds, s.ssim)).collect(),
            mark: Mark::Line,
        };
        let title = format!("{} by {}", run.path, run.link);
        match plots.iter_mut().find(|plot| plot.title == title) {
            Some(plot) => plot.series.push(series),
            None => plots.push(Plot {
                title,
                x: "seconds".into(),
                y: "SSIM".into(),
                x_scale: Scale::Linear,
                y_range: None,
                levels: LEVELS.to_vec(),
                marks: Vec::new(),
                series: vec![series],
            }),
        }
    }
    Section {
        anchor: format!("{}-paths", anchor(&subject.name)),
        title: format!("{}: along camera paths", subject.name),
        lead: "What a visitor sees who does not wait: similarity to the truth from the same place while \
               the camera moves. Popping is what changes from one picture to the next beyond what \
               the truth changes, root mean square of 0 to 255."
            .into(),
        body: html! {
            div.plots { @for plot in &plots { (plot.markup()) } }
            (table.markup())
        },
    }
}

fn range(race: &Race) -> (f64, f64) {
    let all = race.runs.iter().flat_map(|e| &e.run.samples).map(|s| s.ssim);
    let low = all.fold(1.0, f64::min);
    ((low * 10.0).floor() / 10.0, 1.0)
}

fn frames(subject: &SubjectReport) -> Section {
    let mut views: Vec<&str> = Vec::new();
    for row in &subject.frames {
        if !views.contains(&row.view.as_str()) {
            views.push(&row.view);
        }
    }
    let plots = views.iter().map(|view| {
        let rows: Vec<_> = subject.frames.iter().filter(|row| row.view == *view).collect();
        let mut ways: Vec<String> = Vec::new();
        for row in &rows {
            let way = format!("{} {}", row.splat, row.size);
            if !ways.contains(&way) {
                ways.push(way);
            }
        }
        let mut series: Vec<_> = ways
            .iter()
            .enumerate()
            .map(|(index, way)| Series {
                name: way.clone(),
                color: index + 1,
                points: rows
                    .iter()
                    .filter(|row| format!("{} {}", row.splat, row.size) == *way)
                    .map(|row| (row.ms, row.error.ssim.unwrap_or(f64::NAN)))
                    .collect(),
                mark: Mark::Line,
            })
            .collect();
        let front = rows.iter().filter(|row| row.on_front);
        series.push(Series {
            name: "no other is faster and better".into(),
            color: 8,
            points: front.map(|row| (row.ms, row.error.ssim.unwrap_or(f64::NAN))).collect(),
            mark: Mark::Rings,
        });
        let noise = subject.noise.iter().find(|row| row.view == *view);
        Plot {
            title: format!("{view} view"),
            x: "milliseconds a frame".into(),
            y: "SSIM".into(),
            x_scale: Scale::Logarithmic,
            y_range: None,
            levels: noise.map(|row| row.ssim).into_iter().collect(),
            marks: Vec::new(),
            series,
        }
    });
    let mut table = Table::new(&[
        ("view", Align::Word),
        ("splat", Align::Word),
        ("budget", Align::Number),
        ("points", Align::Number),
        ("ms", Align::Number),
        ("SSIM", Align::Number),
        ("PSNR dB", Align::Number),
        ("holes", Align::Number),
        ("spill", Align::Number),
        ("depth RMSE", Align::Number),
    ]);
    for row in &subject.frames {
        let share = |value: Option<f64>| {
            value.map_or("-".into(), |v| Cell::from(format!("{:.2} %", 100.0 * v)))
        };
        let plain = |value: Option<f64>, digits: usize| {
            value.map_or("-".into(), |v| Cell::from(format!("{v:.digits$}")))
        };
        table.rows.push(vec![
            row.view.as_str().into(),
            format!("{} {}", row.splat, row.size).into(),
            thousands(row.budget).into(),
            thousands(row.points).into(),
            Cell::Toned(format!("{:.1}", row.ms), Tone::Plain),
            Cell::Chip(
                row.error.ssim.map_or("-".into(), |s| format!("{s:.4}")),
                if row.on_front { Tone::Good } else { Tone::Plain },
            ),
            plain(row.error.psnr_db, 2),
            share(row.error.coverage.holes.of_covered),
            share(row.error.coverage.spill.of_covered),
            plain(row.error.depth.map(|depth| depth.rmse), 3),
        ]);
    }
    let noise = subject.noise.iter().map(|row| format!("{} {:.4}", row.view, row.ssim));
    let noise: Vec<_> = noise.collect();
    Section {
        anchor: format!("{}-frames", anchor(&subject.name)),
        title: format!("{}: error against milliseconds a frame", subject.name),
        lead: format!(
            "Each dot is a budget; one sample a pixel, as a window draws, on the CPU. The line across is \
             the noise floor: the similarity of two truths whose samples lie elsewhere ({}). A \
             picture of one sample a pixel is aliased and stays below it, however many points it has.",
            noise.join(", ")
        ),
        body: html! {
            div.plots { @for plot in plots { (plot.markup()) } }
            (table.markup())
        },
    }
}

fn left_out(subject: &SubjectReport) -> Section {
    let mut table = Table::new(&[
        ("view", Align::Word),
        ("left out", Align::Text),
        ("nodes", Align::Number),
        ("points", Align::Number),
        ("MB", Align::Number),
        ("MB otherwise", Align::Number),
        ("load", Align::Number),
        ("otherwise", Align::Number),
        ("decode ms", Align::Number),
        ("otherwise", Align::Number),
        ("draw ms", Align::Number),
        ("otherwise", Align::Number),
    ]);
    for row in &subject.left_out {
        let (with, without) = (row.with, row.without);
        let count = |n: Option<u64>| n.map_or("-".into(), |n| Cell::from(thousands(n)));
        table.rows.push(vec![
            row.view.as_str().into(),
            row.saving.as_str().into(),
            count(row.nodes),
            count(row.points),
            format!("{:.2}", with.bytes as f64 / 1e6).into(),
            format!("{:.2}", without.bytes as f64 / 1e6).into(),
            seconds(with.load_ms).into(),
            seconds(without.load_ms).into(),
            format!("{:.0}", with.decode_ms).into(),
            format!("{:.0}", without.decode_ms).into(),
            format!("{:.0}", with.draw_ms).into(),
            format!("{:.0}", without.draw_ms).into(),
        ]);
    }
    let stored = &subject.not_stored;
    let [needed, everything] = stored.shader_bytes;
    let unused: Vec<_> = stored
        .not_fetched
        .iter()
        .map(|(name, bytes)| format!("{name} {}", megabytes(*bytes)))
        .collect();
    Section {
        anchor: format!("{}-left-out", anchor(&subject.name)),
        title: format!("{}: what is left out", subject.name),
        lead: "What is not fetched, decoded or drawn, and what it would cost: each saving is \
               switched off in turn, the others stay. Nodes count without those below them. Splats \
               are seen from both sides, so that none is left out for facing away."
            .into(),
        body: html! {
            (table.markup())
            ul {
                @if !stored.constant_attributes.is_empty() {
                    li { "Not stored, because all points have the same: " (stored.constant_attributes.join(", "))
                        " (" (megabytes(stored.raw_bytes)) " as plain columns)." }
                }
                @if !unused.is_empty() { li { "Not fetched for this look: " (unused.join(", ")) "." } }
                li { "Not compiled: " (everything - needed.min(everything)) " of " (everything)
                    " bytes of shader that draw a cloud with everything." }
            }
        },
    }
}

fn builds(report: &Report) -> Section {
    let mut table = Table::new(&[
        ("dataset", Align::Word),
        ("method", Align::Word),
        ("points in", Align::Number),
        ("points out", Align::Number),
        ("seconds", Align::Number),
        ("M points/s", Align::Number),
        ("peak memory", Align::Number),
        ("bytes/point", Align::Number),
    ]);
    for subject in &report.subjects {
        let Some(build) = &subject.build else { continue };
        table.rows.push(vec![
            subject.name.as_str().into(),
            build.method.as_str().into(),
            thousands(build.points_in).into(),
            thousands(build.points_out).into(),
            format!("{:.2}", build.seconds).into(),
            format!("{:.2}", build.points_per_second / 1e6).into(),
            build.peak_bytes.map_or("-".into(), |b| Cell::from(megabytes(b))),
            format!("{:.2}", build.bytes_per_point).into(),
        ]);
    }
    Section {
        anchor: "build".into(),
        title: "Building".into(),
        lead: "The whole program, from its start to its end.".into(),
        body: table.markup(),
    }
}

fn gallery(exhibits: &[Exhibit]) -> Section {
    Section {
        anchor: "pictures".into(),
        title: "Pictures".into(),
        lead:
            "The truth, the picture within the largest budget, and where the two differ: black is \
               alike."
                .into(),
        body: html! {
            div.tilesheet {
                @for exhibit in exhibits {
                    figure { (image(exhibit)) figcaption { (exhibit.caption) } }
                }
            }
        },
    }
}

fn image(exhibit: &Exhibit) -> Markup {
    let picture = &exhibit.picture;
    let whole = RgbaImage::from_raw(picture.width, picture.height, picture.rgba8.clone());
    let Some(whole) = whole else { return html! {} };
    let width = EXHIBIT_WIDTH.min(picture.width);
    let height = (picture.height * width / picture.width.max(1)).max(1);
    let small = imageops::resize(&whole, width, height, imageops::FilterType::Triangle);
    let mut png = std::io::Cursor::new(Vec::new());
    if image::DynamicImage::ImageRgba8(small)
        .to_rgb8()
        .write_to(&mut png, ImageFormat::Png)
        .is_err()
    {
        return html! {};
    }
    let data = STANDARD.encode(png.into_inner());
    html! { (PreEscaped(format!("<img alt=\"\" loading=\"lazy\" src=\"data:image/png;base64,{data}\">"))) }
}

fn anchor(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

fn seconds(ms: f64) -> String {
    if ms.is_finite() { format!("{:.2} s", ms / 1e3) } else { "-".into() }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MB", bytes as f64 / 1e6)
}

fn percent(part: f64) -> String {
    format!("{:+.0} %", 100.0 * part)
}

fn thousands(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}
