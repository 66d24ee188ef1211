//! Trials of clock, states and cameras while the robot stands.

use super::Verdict;
use super::bench::{Bench, Limb, PERIOD};
use crate::drivers::DriverError;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::Stamp;

/// A state is no older than this, seconds.
const OLDEST_S: f64 = 0.1;
/// States are renewed at least so often, hertz.
const RENEWED_HZ: f64 = 20.0;
/// Images are no older than this when they are read, seconds.
const OLDEST_FRAME_S: f64 = 0.5;
/// A camera may be mounted a little off its place: metres and radians.
const OFF: (f64, f64) = (0.1, 0.09);

pub(super) fn reading_lets_no_time_pass(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let before = bench.now();
    for _ in 0..5 {
        bench.robot.arm().state()?;
        bench.robot.head().state()?;
        bench.robot.base().velocity()?;
        bench.robot.gripper().state()?;
        bench.robot.localisation().world_from_base()?;
        bench.robot.cameras().read("head")?;
    }
    let passed_s = (bench.now() - before).as_s();
    // Hardware cannot stop its clock.
    Ok(Verdict::new((0.0..0.05).contains(&passed_s), format!("{passed_s:.3} s"), "less than 0.05 s"))
}

pub(super) fn waiting_passes_time(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let mut off_s: f64 = 0.0;
    for _ in 0..50 {
        let until = bench.now() + PERIOD;
        bench.robot.clock().wait_until(until)?;
        let late_s = (bench.now() - until).as_s();
        off_s = if late_s.abs() > off_s.abs() { late_s } else { off_s };
    }
    Ok(Verdict::new((0.0..=0.02).contains(&off_s), format!("off by {off_s:.3} s at worst"), "0 to 0.02 s late"))
}

pub(super) fn joints_are_the_models(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    /// Sensors are calibrated to this, radians or metres.
    const SLACK: f64 = 0.05;
    let mut wrong = Vec::new();
    for limb in [Limb::Arm, Limb::Head] {
        let group = bench.group(limb);
        let positions = bench.positions(limb)?;
        if positions.names()[..] != group.joints[..] {
            wrong.push(format!("the {limb:?} has joints {:?}", positions.names()));
            continue;
        }
        for ((name, value), limits) in positions.iter().zip(&group.limits) {
            if !(value >= limits.lower - SLACK && value <= limits.upper + SLACK) {
                wrong.push(format!("{name} at {value:.3}"));
            }
        }
    }
    let measured = if wrong.is_empty() { "all as in the model".to_owned() } else { wrong.join("; ") };
    Ok(Verdict::new(wrong.is_empty(), measured, "the joints of robot.toml in their order, within the URDF's limits"))
}

pub(super) fn states_are_fresh(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    const SECONDS: f64 = 1.0;
    let mut renewed = [0; 4];
    let mut last = [Stamp(i64::MIN); 4];
    let mut oldest_s: f64 = 0.0;
    let mut went_back = false;
    for _ in 0..(SECONDS / PERIOD.as_s()) as usize {
        bench.wait(PERIOD)?;
        let now = bench.now();
        let stamps = [
            bench.robot.arm().state()?.stamp,
            bench.robot.head().state()?.stamp,
            bench.robot.gripper().state()?.stamp,
            bench.robot.localisation().world_from_base()?.stamp,
        ];
        for (k, stamp) in stamps.into_iter().enumerate() {
            renewed[k] += usize::from(stamp > last[k]);
            went_back |= stamp < last[k] || stamp > now;
            last[k] = stamp;
            oldest_s = oldest_s.max((now - stamp).as_s());
        }
    }
    let rate_hz = renewed.into_iter().min().unwrap_or(0) as f64 / SECONDS;
    let order = if went_back { "stamps out of order" } else { "stamps in order" };
    Ok(Verdict::new(
        !went_back && oldest_s <= OLDEST_S && rate_hz >= RENEWED_HZ,
        format!("{order}, {oldest_s:.3} s old at worst, the slowest at {rate_hz:.0} Hz"),
        format!("stamps in order, {OLDEST_S} s old at most, {RENEWED_HZ:.0} Hz"),
    ))
}

/// All images of a camera within some seconds, each shown to `see` with the time of its reading.
fn watch(
    bench: &mut Bench<'_>,
    camera: &str,
    seconds: f64,
    mut see: impl FnMut(&RgbdFrame, Stamp),
) -> Result<(), DriverError> {
    for _ in 0..(seconds / PERIOD.as_s()) as usize {
        let until = bench.now() + PERIOD;
        bench.robot.clock().wait_until(until)?;
        let now = bench.now();
        if let Some(frame) = bench.robot.cameras().read(camera)? {
            see(&frame, now);
        }
    }
    Ok(())
}

pub(super) fn cameras_keep_their_rate(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    const SECONDS: f64 = 2.0;
    let (mut told, mut good) = (Vec::new(), true);
    for settings in &bench.model.settings.camera {
        let mut seen: Vec<(FrameId, Stamp)> = Vec::new();
        let mut flaws = 0;
        watch(bench, &settings.name, SECONDS, |frame, now| {
            let is_new = seen.last().is_none_or(|(id, stamp)| frame.id != *id && frame.stamp > *stamp);
            let fits = (frame.model.width, frame.model.height) == (settings.width, settings.height)
                && frame.depth_m.len() == frame.model.pixel_count()
                && frame.color.len() == frame.model.pixel_count();
            let sound = frame.depth_m.iter().all(|depth| depth.is_finite() && *depth >= 0.0);
            let fresh = (0.0..=OLDEST_FRAME_S).contains(&(now - frame.stamp).as_s());
            flaws += usize::from(!(is_new && fits && sound && fresh));
            seen.push((frame.id, frame.stamp));
        })?;
        let rate_hz = seen.len() as f64 / SECONDS;
        good &= flaws == 0 && (rate_hz - settings.rate_hz).abs() <= 0.2 * settings.rate_hz;
        told.push(format!("{}: {rate_hz:.1} Hz of {:.1}, {flaws} flawed", settings.name, settings.rate_hz));
    }
    let unknown = matches!(bench.robot.cameras().read("no such camera"), Err(DriverError::NoCamera { .. }));
    if !unknown {
        told.push("a camera that there is not is not refused".into());
    }
    let required = format!("each within 20 % of its rate; new, whole, finite and at most {OLDEST_FRAME_S} s old");
    Ok(Verdict::new(good && unknown, told.join("; "), required))
}

pub(super) fn cameras_are_where_they_are(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let mut worst = (0.0_f64, 0.0_f64);
    let mut seen = 0;
    for settings in &bench.model.settings.camera {
        let Some((_, link)) = bench.model.find_camera(&settings.name) else { continue };
        let mut frame_pose = None;
        watch(bench, &settings.name, 1.5 / settings.rate_hz, |frame, _| frame_pose = Some(frame.world_from_camera))?;
        let Some(world_from_camera) = frame_pose else { continue };
        let mut configuration = bench.model.kinematics.zero();
        configuration.apply(&bench.positions(Limb::Arm)?);
        configuration.apply(&bench.positions(Limb::Head)?);
        let world_from_base = bench.robot.localisation().world_from_base()?.pose;
        let expected = world_from_base * bench.model.kinematics.root_from_link(&configuration, link);
        let off = expected.inv_mul(&world_from_camera);
        worst = (worst.0.max(off.translation.vector.norm()), worst.1.max(off.rotation.angle()));
        seen += 1;
    }
    Ok(Verdict::new(
        seen == bench.model.settings.camera.len() && worst.0 <= OFF.0 && worst.1 <= OFF.1,
        format!("{seen} cameras, off by {:.3} m and {:.3} rad at worst", worst.0, worst.1),
        format!("{} cameras within {} m and {} rad", bench.model.settings.camera.len(), OFF.0, OFF.1),
    ))
}
