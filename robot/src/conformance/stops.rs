//! Trials of what stops a robot: silence and the emergency stop.

use super::Verdict;
use super::bench::{Bench, Limb, PERIOD, STANDS};
use crate::drivers::{DRIVER_TIMEOUT, DriverError, Twist};
use crate::joints::JointVelocities;
use dsm::time::Stamp;

const SPEED_M_PER_S: f64 = 0.2;
/// Motors settle within this after they were told to stand, seconds.
const SETTLE_S: f64 = 0.3;

/// Runs the base up to speed.
fn run_up(bench: &mut Bench<'_>) -> Result<(), DriverError> {
    for _ in 0..80 {
        bench.robot.base().command(Twist { forward_m_per_s: SPEED_M_PER_S, turn_rad_per_s: 0.0 })?;
        bench.wait(PERIOD)?;
    }
    Ok(())
}

/// Seconds until the base stands for good, of `seconds` at most.
fn find_standstill_s(bench: &mut Bench<'_>, seconds: f64) -> Result<f64, DriverError> {
    let begin = bench.now();
    let mut moved: Stamp = begin;
    while (bench.now() - begin).as_s() < seconds {
        bench.wait(PERIOD)?;
        let velocity = bench.robot.base().velocity()?;
        if velocity.forward_m_per_s.abs().max(velocity.turn_rad_per_s.abs()) > STANDS {
            moved = bench.now();
        }
    }
    Ok((moved - begin).as_s())
}

fn braking_s(bench: &Bench<'_>) -> f64 {
    SPEED_M_PER_S / bench.model.settings.base.max_acceleration_m_per_s2
}

pub(super) fn silent_base_stands(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    run_up(bench)?;
    let speed = bench.robot.base().velocity()?.forward_m_per_s;
    let stands_s = find_standstill_s(bench, 2.0)?;
    let required_s = DRIVER_TIMEOUT.as_s() + braking_s(bench) + SETTLE_S;
    Ok(Verdict::new(
        speed > 0.5 * SPEED_M_PER_S && stands_s <= required_s,
        format!("from {speed:.2} m/s it stands after {stands_s:.2} s"),
        format!("it drove, and stands within {required_s:.2} s"),
    ))
}

pub(super) fn silent_joints_stand(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    const SPEED: f64 = 0.2;
    let limb = Limb::Head;
    let group = bench.group(limb);
    let position = bench.positions(limb)?.values()[0];
    let way = if position > 0.5 * (group.limits[0].lower + group.limits[0].upper) { -1.0 } else { 1.0 };
    let mut velocities = JointVelocities::zeros(&group.joints);
    velocities.values_mut()[0] = way * SPEED;
    for _ in 0..30 {
        bench.command(limb, &velocities)?;
        bench.wait(PERIOD)?;
    }
    let begin = bench.now();
    let mut last = bench.positions(limb)?.values()[0];
    let ran = (last - position).abs();
    let mut moved = begin;
    while (bench.now() - begin).as_s() < 2.0 {
        bench.wait(PERIOD)?;
        let now = bench.positions(limb)?.values()[0];
        if (now - last).abs() > STANDS * PERIOD.as_s() {
            moved = bench.now();
        }
        last = now;
    }
    let stands_s = (moved - begin).as_s();
    let required_s = DRIVER_TIMEOUT.as_s() + SETTLE_S;
    Ok(Verdict::new(
        ran > 0.01 && stands_s <= required_s,
        format!("after {ran:.3} rad it stands {stands_s:.2} s later"),
        format!("it moved, and stands within {required_s:.2} s"),
    ))
}

pub(super) fn stop_is_latched(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    const FIRST: &str = "a trial of the emergency stop";
    run_up(bench)?;
    let speed = bench.robot.base().velocity()?.forward_m_per_s;
    bench.robot.emergency_stop().trigger(FIRST)?;
    bench.robot.emergency_stop().trigger("pressed again")?;
    let drives = Twist { forward_m_per_s: SPEED_M_PER_S, turn_rad_per_s: 0.0 };
    let refused = matches!(bench.robot.base().command(drives), Err(DriverError::Stopped { .. }));
    let still = JointVelocities::zeros(&bench.model.arm.joints);
    let arm_refused = matches!(bench.robot.arm().command(&still), Err(DriverError::Stopped { .. }));
    let stands_s = find_standstill_s(bench, 1.5)?;
    let kept = bench.robot.emergency_stop().find_reason().is_some_and(|reason| reason.contains(FIRST));
    bench.robot.emergency_stop().reset()?;
    let released = bench.robot.emergency_stop().find_reason().is_none()
        && bench.robot.base().command(Twist::default()).is_ok()
        && bench.robot.arm().command(&still).is_ok();
    let required_s = braking_s(bench) + SETTLE_S;
    let words = |done: bool, what: &str| format!("{}{what}", if done { "" } else { "not " });
    Ok(Verdict::new(
        speed > 0.5 * SPEED_M_PER_S && stands_s <= required_s && refused && arm_refused && kept && released,
        format!(
            "stands after {stands_s:.2} s, {}, {}, {}",
            words(refused && arm_refused, "refused"),
            words(kept, "kept its reason"),
            words(released, "released")
        ),
        format!("it drove; stands within {required_s:.2} s, refused, kept its reason, released"),
    ))
}
