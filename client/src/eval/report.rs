//! All that an evaluation found, as JSON and as tables of CSV. `docs/EVALUATION.md` specifies both.

use serde::{Deserialize, Serialize};

use super::{
    along::PathRun,
    curve::{area, bytes_at_equal_error},
    frame::FrameRow,
    left_out::{NotStored, SavingRow},
    stream::{LEVELS, StreamRun},
};
use crate::engine::Policy;

/// The whole report.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Report {
    /// `lodestream-eval`.
    pub format: String,
    /// Of the format.
    pub version: u32,
    /// Of the program.
    pub lodestream: String,
    /// What times hang on.
    pub machine: String,
    /// The command line that does the same.
    pub command: String,
    /// Of the links' losses and of the samples' places.
    pub seed: u64,
    /// Width and height of the pictures.
    pub size_px: [u32; 2],
    /// Samples along each side of a pixel, of truths and of what streams in.
    pub samples: u32,
    /// Dataset by dataset.
    pub subjects: Vec<SubjectReport>,
}

/// What was found of a dataset.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SubjectReport {
    /// Of the file, without its ending.
    pub name: String,
    /// Points.
    pub points: u64,
    /// Of the file.
    pub bytes: u64,
    /// Of all nodes in the encoding of PotreeConverter 2 (BROTLI), where they were weighed.
    #[serde(default)]
    pub potree_bytes: Option<u64>,
    /// The same with the attributes that are shown alone.
    #[serde(default)]
    pub potree_shown_bytes: Option<u64>,
    /// How it was built, where that was part of it.
    pub build: Option<BuildRow>,
    /// View by view.
    pub noise: Vec<NoiseRow>,
    /// Way by way to draw.
    pub frames: Vec<FrameRow>,
    /// Run by run.
    pub streams: Vec<StreamRun>,
    /// Path by path.
    pub paths: Vec<PathRun>,
    /// What the file does without.
    pub not_stored: NotStored,
    /// Saving by saving.
    pub left_out: Vec<SavingRow>,
}

/// How a dataset was built.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BuildRow {
    /// The method.
    pub method: String,
    /// Of the whole program.
    pub seconds: f64,
    /// Per second.
    pub points_per_second: f64,
    /// Most memory at once; `None` where the system does not tell.
    pub peak_bytes: Option<u64>,
    /// Of the file, per point.
    pub bytes_per_point: f64,
    /// Points read.
    pub points_in: u64,
    /// Points in the dataset.
    pub points_out: u64,
}

/// How far a truth is to be trusted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct NoiseRow {
    /// The view.
    pub view: String,
    /// Similarity of two truths with different samples.
    pub ssim: f64,
    /// Their mean squared error.
    pub mse: f64,
    /// Share of the picture that the cloud covers.
    pub coverage: f64,
}

/// Runs of one view on one link, and what they come to.
#[derive(Debug, Clone)]
pub struct Race<'a> {
    /// The view.
    pub view: &'a str,
    /// What was there before.
    pub from: &'a str,
    /// The link.
    pub link: &'a str,
    /// A policy's run and figures, in the order of the report.
    pub runs: Vec<Entrant<'a>>,
}

/// A policy in a race.
#[derive(Debug, Clone)]
pub struct Entrant<'a> {
    /// The run.
    pub run: &'a StreamRun,
    /// Seconds times missing similarity until the slowest is done.
    pub area: f64,
    /// Bytes at equal error against `potree`, as a part of its bytes, less 1.
    pub bytes_saved: Option<f64>,
}

impl SubjectReport {
    /// The runs, those of one view and link together.
    #[must_use]
    pub fn races(&self) -> Vec<Race<'_>> {
        let mut races: Vec<Race> = Vec::new();
        for run in &self.streams {
            let same = |race: &&mut Race| {
                (race.view, race.from, race.link) == (&run.view, &run.from, &run.link)
            };
            let entrant = Entrant { run, area: 0.0, bytes_saved: None };
            match races.iter_mut().find(same) {
                Some(race) => race.runs.push(entrant),
                None => races.push(Race {
                    view: &run.view,
                    from: &run.from,
                    link: &run.link,
                    runs: vec![entrant],
                }),
            }
        }
        for race in &mut races {
            let last = |e: &Entrant| e.run.samples.last().map_or(0.0, |sample| sample.ms);
            let horizon = race.runs.iter().map(last).fold(0.0, f64::max);
            let baseline = race.runs.iter().find(|e| e.run.policy == Policy::Potree);
            let baseline = baseline.map(|e| &e.run.samples);
            for entrant in &mut race.runs {
                entrant.area = area(&entrant.run.samples, horizon);
                entrant.bytes_saved =
                    baseline.and_then(|b| bytes_at_equal_error(&entrant.run.samples, b));
            }
        }
        races
    }
}

impl Report {
    /// As JSON.
    #[must_use]
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("texts and numbers always serialize") + "\n"
    }

    /// Tables: a file name and its CSV each.
    #[must_use]
    pub fn tables(&self) -> Vec<(&'static str, String)> {
        vec![
            ("build.csv", self.build_csv()),
            ("frame.csv", self.frame_csv()),
            ("stream.csv", self.stream_csv()),
            ("stream_samples.csv", self.samples_csv()),
            ("path.csv", self.path_csv()),
            ("left_out.csv", self.left_out_csv()),
        ]
    }

    fn build_csv(&self) -> String {
        let header = "dataset method seconds points_per_second peak_bytes bytes_per_point points_in points_out";
        table(header, |line| {
            for subject in &self.subjects {
                let Some(b) = &subject.build else { continue };
                line(vec![
                    subject.name.clone(),
                    b.method.clone(),
                    number(b.seconds),
                    number(b.points_per_second),
                    optional(b.peak_bytes.map(|bytes| bytes as f64)),
                    number(b.bytes_per_point),
                    b.points_in.to_string(),
                    b.points_out.to_string(),
                ]);
            }
        })
    }

    fn frame_csv(&self) -> String {
        let header = "dataset view splat size budget points nodes ms ms_spread ssim mse psnr_db holes \
                      spill depth_rmse on_front";
        table(header, |line| {
            for (subject, f) in
                self.subjects.iter().flat_map(|s| s.frames.iter().map(move |f| (s, f)))
            {
                line(vec![
                    subject.name.clone(),
                    f.view.clone(),
                    f.splat.clone(),
                    f.size.clone(),
                    f.budget.to_string(),
                    f.points.to_string(),
                    f.nodes.to_string(),
                    number(f.ms),
                    number(f.ms_spread),
                    optional(f.error.ssim),
                    optional(f.error.mse),
                    optional(f.error.psnr_db),
                    optional(f.error.coverage.holes.of_covered),
                    optional(f.error.coverage.spill.of_covered),
                    optional(f.error.depth.map(|depth| depth.rmse)),
                    f.on_front.to_string(),
                ]);
            }
        })
    }

    fn stream_csv(&self) -> String {
        let header = "dataset view from link policy settled_ms bound_ms bytes requests points ssim \
                      area bytes_saved ms_090 bytes_090 ms_095 bytes_095 ms_098 bytes_098";
        table(header, |line| {
            for subject in &self.subjects {
                for race in subject.races() {
                    for Entrant { run, area, bytes_saved } in race.runs {
                        let mut cells = vec![
                            subject.name.clone(),
                            run.view.clone(),
                            run.from.clone(),
                            run.link.clone(),
                            run.policy.name().into(),
                            optional(run.settled_ms),
                            number(run.bound_ms),
                            run.bytes.to_string(),
                            run.requests.to_string(),
                            run.points.to_string(),
                            number(run.ssim),
                            number(area),
                            optional(bytes_saved),
                        ];
                        for level in 0..LEVELS.len() {
                            let reached = run.reached.get(level).copied().flatten();
                            cells.push(optional(reached.map(|r| r.ms)));
                            cells.push(optional(reached.map(|r| r.bytes as f64)));
                        }
                        line(cells);
                    }
                }
            }
        })
    }

    fn samples_csv(&self) -> String {
        let header = "dataset view from link policy ms bytes requests points ssim mse holes";
        table(header, |line| {
            for (subject, run) in
                self.subjects.iter().flat_map(|s| s.streams.iter().map(move |r| (s, r)))
            {
                for sample in &run.samples {
                    line(vec![
                        subject.name.clone(),
                        run.view.clone(),
                        run.from.clone(),
                        run.link.clone(),
                        run.policy.name().into(),
                        number(sample.ms),
                        sample.bytes.to_string(),
                        sample.requests.to_string(),
                        sample.points.to_string(),
                        number(sample.ssim),
                        number(sample.mse),
                        number(sample.holes),
                    ]);
                }
            }
        })
    }

    fn path_csv(&self) -> String {
        let header = "dataset path link policy seconds ssim points bytes mean_ssim worst_ssim \
                      popping_rms requests cancelled";
        table(header, |line| {
            for (subject, run) in
                self.subjects.iter().flat_map(|s| s.paths.iter().map(move |r| (s, r)))
            {
                for sample in &run.samples {
                    line(vec![
                        subject.name.clone(),
                        run.path.clone(),
                        run.link.clone(),
                        run.policy.name().into(),
                        number(sample.seconds),
                        number(sample.ssim),
                        sample.points.to_string(),
                        sample.bytes.to_string(),
                        number(run.mean_ssim),
                        number(run.worst_ssim),
                        optional(run.popping_rms),
                        run.requests.to_string(),
                        run.cancelled.to_string(),
                    ]);
                }
            }
        })
    }

    fn left_out_csv(&self) -> String {
        let header = "dataset view saving nodes points bytes_with bytes_without load_ms_with \
                      load_ms_without decode_ms_with decode_ms_without draw_ms_with draw_ms_without \
                      points_with points_without";
        table(header, |line| {
            for (subject, row) in
                self.subjects.iter().flat_map(|s| s.left_out.iter().map(move |r| (s, r)))
            {
                let (with, without) = (row.with, row.without);
                line(vec![
                    subject.name.clone(),
                    row.view.clone(),
                    row.saving.clone(),
                    optional(row.nodes.map(|nodes| nodes as f64)),
                    optional(row.points.map(|points| points as f64)),
                    with.bytes.to_string(),
                    without.bytes.to_string(),
                    number(with.load_ms),
                    number(without.load_ms),
                    number(with.decode_ms),
                    number(without.decode_ms),
                    number(with.draw_ms),
                    number(without.draw_ms),
                    with.points.to_string(),
                    without.points.to_string(),
                ]);
            }
        })
    }
}

fn table(header: &str, fill: impl FnOnce(&mut dyn FnMut(Vec<String>))) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let columns = header.split_whitespace().map(str::to_owned).collect();
    let mut line = |cells: Vec<String>| {
        writer.write_record(cells).expect("lines of text go into memory");
    };
    line(columns);
    fill(&mut line);
    let bytes = writer.into_inner().expect("memory can be written");
    String::from_utf8(bytes).expect("made of strings")
}

/// All digits that tell it apart.
fn number(value: f64) -> String {
    match value {
        v if v.is_nan() => String::new(),
        v if v == f64::INFINITY => "Infinity".into(),
        v => format!("{v}"),
    }
}

/// Nothing where there is no number.
fn optional(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}
