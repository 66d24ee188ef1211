//! `dsm bench`: one table of speeds that can be quoted. The only command whose results are wall times.

use super::bench_map::{Drive, KEPT_FRAMES, SeenFrame, measure_updates};
use super::run::set_threads;
use super::{Output, ResultArgs, WorldArgs};
use crate::assemble::{Assembled, assemble, grounder, knowledge};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::run::{RunSpec, Silent, run_episode};
use crate::settings::Settings;
use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::camera::CameraModel;
use dsm::map::Map;
use dsm::perceive::{Detector, PixelSegmenter};
use dsm::raster::look_at;
use dsm::time::Span;
use dsm_robot::drivers::{Robot, Twist};
use dsm_sim::camera::{CameraRig, LightDraw, TrueImage};
use dsm_sim::scene::SceneModel;
use nalgebra::Point3;
use serde::Serialize;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Arguments of `dsm bench`.
#[derive(Debug, clap::Args)]
pub struct BenchArgs {
    /// A scene: its folder or its MJCF file.
    #[arg(default_value = "scenes/apartment")]
    scene: PathBuf,
    /// Simulated seconds of each measurement.
    #[arg(long, default_value_t = 20.0, value_parser = seconds)]
    seconds: f64,
    /// Words that are grounded.
    #[arg(long, default_value = "the chair near the table")]
    words: String,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// The table.
#[derive(Debug, Serialize)]
struct Table {
    threads: u16,
    bodies: usize,
    triangles: usize,
    rows: Vec<Row>,
}

/// One line of the table.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    /// What is measured.
    pub(super) what: &'static str,
    /// Rate or time.
    pub(super) value: f64,
    /// Its unit.
    pub(super) unit: &'static str,
    /// Number of measurements.
    pub(super) count: usize,
    /// Simulated seconds that pass in a second of this stage alone; the loop needs all stages.
    pub(super) real_time_factor: Option<f64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("expected seconds, got `{text}`"))?;
    if (1.0..=600.0).contains(&value) { Ok(value) } else { Err("expected 1 to 600 seconds".into()) }
}

/// Wall time of one stage, summed up.
#[derive(Default)]
struct Watch {
    total_s: f64,
    count: usize,
}

impl Watch {
    /// Runs `work` and adds its wall time.
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        // Wall time is what this command is for.
        #[expect(clippy::disallowed_methods)]
        let begin = std::time::Instant::now();
        let result = work();
        self.total_s += begin.elapsed().as_secs_f64();
        self.count += 1;
        result
    }

    /// Mean wall time of something that is done once in `sim_s` simulated seconds, or whenever somebody asks.
    fn mean_ms(&self, what: &'static str, sim_s: Option<f64>) -> Row {
        let mean_s = self.total_s / self.count.max(1) as f64;
        let real_time_factor = sim_s.map(|sim_s| sim_s / mean_s.max(1e-9));
        Row { what, value: 1e3 * mean_s, unit: "ms", count: self.count, real_time_factor }
    }

    /// How often something is done in a second; each time stands for `sim_s` simulated seconds.
    fn rate(&self, what: &'static str, unit: &'static str, sim_s: f64) -> Row {
        let value = self.count as f64 / self.total_s.max(1e-9);
        Row { what, value, unit, count: self.count, real_time_factor: Some(value * sim_s) }
    }
}

/// The head camera takes a frame every so many simulated seconds.
const FRAME_PERIOD_S: f64 = 0.2;

/// Measures and prints the table.
pub(super) fn run(args: BenchArgs) -> anyhow::Result<u8> {
    let settings = Settings::resolve(&args.world, None, &|_| false)?;
    let threads = settings.threads.value;
    set_threads(threads)?;
    let spec = RunSpec {
        robot: settings.robot.value,
        physics: settings.physics.value,
        perception: settings.perception.value,
        seed: settings.seed.value,
        ..RunSpec::new("bench", Episode::exploration(args.scene.clone(), args.seconds))
    };
    let mut rows = Vec::new();
    let (bodies, triangles) = measure_raster(&spec, &mut rows)?;
    let drive = measure_parts(&spec, &mut rows)?;
    measure_updates(&drive, &mut rows)?;
    let map = drive.map;
    measure_grounding(&map, &args.words, &mut rows)?;
    measure_episode(&spec, &mut rows)?;
    let table = Table { threads, bodies, triangles, rows };
    Output::new(args.result).give(&table, || describe(&table, &spec))?;
    Ok(0)
}

/// Colour, depth and labels of the scene in one pass, without sensor noise, all around its middle.
fn measure_raster(spec: &RunSpec, rows: &mut Vec<Row>) -> anyhow::Result<(usize, usize)> {
    const VIEWS: usize = 60;
    let scene = SceneModel::load(&spec.scene)?;
    let poses: Vec<dsm::Pose> = scene.bodies.iter().map(|body| body.world_from_body).collect();
    let mut rig = CameraRig::new(&scene, &[], &LightDraw::new(spec.seed))?;
    let camera = CameraModel::from_vertical_fov(640, 480, 1.0);
    let mut image = TrueImage::default();
    let mut watch = Watch::default();
    for view in 0..2 * VIEWS {
        let angle = view as f64 / VIEWS as f64 * std::f64::consts::TAU;
        let eye = Point3::new(0.0, 0.0, 1.25);
        let pose = look_at(&eye, &Point3::new(angle.cos(), angle.sin(), 0.9));
        // The first round fills buffers and caches.
        if view < VIEWS {
            rig.render_into(&poses, &[], &camera, &pose, &mut image);
        } else {
            watch.time(|| rig.render_into(&poses, &[], &camera, &pose, &mut image));
        }
    }
    rows.push(watch.rate("rendering 640x480 colour, depth, labels", "frames/s", FRAME_PERIOD_S));
    Ok((scene.bodies.len(), rig.triangle_count()))
}

/// Physics, camera, detector and mapping, one after the other, while the robot turns on the spot.
fn measure_parts(spec: &RunSpec, rows: &mut Vec<Row>) -> anyhow::Result<Drive> {
    const PERIOD: Span = Span(10_000_000);
    const TURN_RAD_PER_S: f64 = 0.5;
    let Assembled { mut robot, model, mut detector, .. } = assemble(spec)?;
    let mut builder = MapBuilder::new(BuildConfig::default(), knowledge()?);
    let mut map = Map::new(crate::run::CELL_M);
    let (mut steps, mut frames, mut detecting, mut segmenting, mut mapping) =
        (Watch::default(), Watch::default(), Watch::default(), Watch::default(), Watch::default());
    let mut segmenter = PixelSegmenter;
    let mut seen: VecDeque<SeenFrame> = VecDeque::new();
    let robot: &mut dyn Robot = robot.as_mut();
    for _ in 0..(spec.time_limit_s / PERIOD.as_s()) as usize {
        robot.base().command(Twist { forward_m_per_s: 0.0, turn_rad_per_s: TURN_RAD_PER_S })?;
        let end = robot.clock().now() + PERIOD;
        steps.time(|| robot.clock().wait_until(end))?;
        let mut watch = Watch::default();
        let Some(frame) = watch.time(|| robot.cameras().read("head"))? else { continue };
        frames.total_s += watch.total_s;
        frames.count += 1;
        let mut configuration = model.kinematics.zero();
        configuration.apply(&robot.arm().state()?.positions);
        configuration.apply(&robot.head().state()?.positions);
        let world_from_base = robot.localisation().world_from_base()?.pose;
        let carrier = Carrier { bodies: model.link_boxes(&configuration, &world_from_base), ..Carrier::default() };
        let detections = detecting.time(|| detector.detect(&frame));
        mapping.time(|| {
            let update = builder.observe(&map, &frame, &detections, &carrier);
            map.apply(update);
        });
        segmenting.time(|| segmenter.detect(&frame));
        if seen.len() == KEPT_FRAMES {
            seen.pop_front();
        }
        seen.push_back(SeenFrame { frame, detections, carrier });
    }
    // A control period is several steps.
    let step = dsm_sim::physics::PhysicsConfig::default().step;
    steps.count *= (PERIOD.0 / step.0).max(1) as usize;
    rows.push(steps.rate("physics with the whole scene", "steps/s", step.as_s()));
    rows.push(frames.mean_ms("camera frame with sensor noise", Some(FRAME_PERIOD_S)));
    rows.push(detecting.mean_ms("simulated detector, a frame", Some(FRAME_PERIOD_S)));
    rows.push(segmenting.mean_ms("segmenter in pixels alone, a frame", Some(FRAME_PERIOD_S)));
    rows.push(mapping.mean_ms("mapping, a frame", Some(FRAME_PERIOD_S)));
    Ok(Drive { map, frames: seen.into() })
}

fn measure_grounding(map: &Map, words: &str, rows: &mut Vec<Row>) -> Result<(), TaskError> {
    const TIMES: usize = 20;
    let grounder = grounder()?;
    let mut watch = Watch::default();
    for _ in 0..TIMES {
        watch.time(|| grounder.ground(map, words, None));
    }
    rows.push(watch.mean_ms("grounding a sentence", None));
    Ok(())
}

/// The whole loop, exploring.
fn measure_episode(spec: &RunSpec, rows: &mut Vec<Row>) -> Result<(), TaskError> {
    let mut watch = Watch::default();
    let finished = watch.time(|| run_episode(spec, None, Arc::new(AtomicBool::new(false)), Box::new(Silent)))?;
    let factor = finished.summary.metrics.sim_time_s / watch.total_s.max(1e-9);
    rows.push(Row {
        what: "episode, exploring, loading included",
        value: watch.total_s,
        unit: "s",
        count: 1,
        real_time_factor: Some(factor),
    });
    Ok(())
}

fn describe(table: &Table, spec: &RunSpec) -> String {
    let mut text = format!(
        "{}: {} bodies, {} triangles, seed {}, {} threads, {:.0} simulated s\n",
        spec.scene.display(),
        table.bodies,
        table.triangles,
        spec.seed,
        table.threads,
        spec.time_limit_s
    );
    text += &format!("  {:<42} {:>10} {:<9} {:>11}  {:>6}\n", "", "", "", "x real time", "n");
    for row in &table.rows {
        let factor = row.real_time_factor.map_or_else(|| "-".to_owned(), |factor| format!("{factor:.1}"));
        text += &format!("  {:<42} {:>10.1} {:<9} {factor:>11}  {:>6}\n", row.what, row.value, row.unit, row.count);
    }
    text
}
