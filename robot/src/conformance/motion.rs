//! Trials of what parts do when they are commanded.

use super::Verdict;
use super::bench::{Bench, Driven, Limb, PERIOD};
use crate::drivers::{DriverError, Twist};
use crate::joints::JointVelocities;

/// Speeds of the trials: slow enough to step aside.
const SPEED_M_PER_S: f64 = 0.2;
const TURN_RAD_PER_S: f64 = 0.5;
const SECONDS: f64 = 1.5;
/// What a motion may be off by: a share, and metres or radians.
const OFF: (f64, f64) = (0.15, 0.02);

fn is_near(value: f64, expected: f64) -> bool {
    (value - expected).abs() <= OFF.0 * expected.abs() + OFF.1
}

fn yaw_rad(driven: &Driven) -> f64 {
    driven.odom.rotation.euler_angles().2
}

/// Drives straight on, and judges the way against the sum of what was sent.
fn straight(bench: &mut Bench<'_>, speed_m_per_s: f64) -> Result<Verdict, DriverError> {
    let twist = Twist { forward_m_per_s: speed_m_per_s, turn_rad_per_s: 0.0 };
    let driven = bench.drive(twist, SECONDS)?;
    let way = driven.odom.translation.vector;
    let (measured, told) = (driven.measured.forward_m_per_s, driven.told.forward_m_per_s);
    let moved = driven.sent.forward_m_per_s * speed_m_per_s > 0.0 && told.abs() > 0.5 * speed_m_per_s.abs();
    let passed = moved && is_near(way.x, driven.sent.forward_m_per_s) && way.y.abs() < 0.05 && is_near(measured, told);
    Ok(Verdict::new(
        passed,
        format!("{:.3} m ahead, {:.3} m aside, {measured:.3} m/s", way.x, way.y),
        format!("{:.3} m ahead as sent, 0 aside, {told:.3} m/s", driven.sent.forward_m_per_s),
    ))
}

pub(super) fn base_drives_forwards(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    straight(bench, SPEED_M_PER_S)
}

pub(super) fn base_drives_backwards(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    straight(bench, -SPEED_M_PER_S)
}

pub(super) fn base_turns_left(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let driven = bench.drive(Twist { forward_m_per_s: 0.0, turn_rad_per_s: TURN_RAD_PER_S }, SECONDS)?;
    let (turned, sent) = (yaw_rad(&driven), driven.sent.turn_rad_per_s);
    let (measured, told) = (driven.measured.turn_rad_per_s, driven.told.turn_rad_per_s);
    let shift_m = driven.odom.translation.vector.norm();
    bench.drive(Twist { forward_m_per_s: 0.0, turn_rad_per_s: -TURN_RAD_PER_S }, SECONDS)?;
    let moved = told > 0.5 * TURN_RAD_PER_S;
    Ok(Verdict::new(
        moved && is_near(turned, sent) && is_near(measured, told) && shift_m < 0.05,
        format!("{turned:.3} rad to the left, {measured:.3} rad/s, {shift_m:.3} m aside"),
        format!("{sent:.3} rad as sent, {told:.3} rad/s, less than 0.05 m aside"),
    ))
}

pub(super) fn localisation_follows(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    /// Localisation wanders: metres and radians over the whole way.
    const WANDERS: (f64, f64) = (0.1, 0.05);
    let twist = Twist { forward_m_per_s: SPEED_M_PER_S, turn_rad_per_s: TURN_RAD_PER_S };
    let there = bench.drive(twist, SECONDS)?;
    bench.drive(Twist { forward_m_per_s: -SPEED_M_PER_S, turn_rad_per_s: -TURN_RAD_PER_S }, SECONDS)?;
    let off = there.odom.inv_mul(&there.world);
    let (off_m, off_rad) = (off.translation.vector.norm(), off.rotation.angle());
    let drove_m = there.odom.translation.vector.norm();
    Ok(Verdict::new(
        off_m <= WANDERS.0 && off_rad <= WANDERS.1 && drove_m > 0.5 * SPEED_M_PER_S * SECONDS,
        format!("{off_m:.3} m and {off_rad:.3} rad apart after {drove_m:.2} m"),
        format!("at most {} m and {} rad apart", WANDERS.0, WANDERS.1),
    ))
}

/// Moves each joint alone a little towards the middle of its range and back.
fn limb_follows(bench: &mut Bench<'_>, limb: Limb, speed: f64) -> Result<Verdict, DriverError> {
    /// How far another joint may give way, radians or metres.
    const STILL: f64 = 0.02;
    /// What a joint may be off by: a share, and radians or metres.
    const JOINT_OFF: (f64, f64) = (0.2, 0.006);
    const TICKS: usize = 50;
    let group = bench.group(limb);
    let mut wrong = Vec::new();
    let mut worst: f64 = 0.0;
    for k in 0..group.len() {
        let start = bench.positions(limb)?;
        let limits = &group.limits[k];
        let middle = if limits.lower.is_finite() { 0.5 * (limits.lower + limits.upper) } else { 0.0 };
        let way = if start.values()[k] > middle { -1.0 } else { 1.0 };
        let mut velocities = JointVelocities::zeros(&group.joints);
        velocities.values_mut()[k] = way * speed.min(0.5 * limits.velocity);
        let still = JointVelocities::zeros(&group.joints);
        let mut sent = 0.0;
        for tick in 0..TICKS + 20 {
            let before = bench.now();
            let answer = bench.command(limb, if tick < TICKS { &velocities } else { &still })?;
            bench.wait(PERIOD)?;
            sent += answer.values()[k] * (bench.now() - before).as_s();
        }
        let moved = bench.positions(limb)?;
        for (j, name) in group.joints.iter().enumerate() {
            let by = moved.values()[j] - start.values()[j];
            let (expected, slack) = if j == k { (sent, JOINT_OFF.0 * sent.abs() + JOINT_OFF.1) } else { (0.0, STILL) };
            worst = worst.max((by - expected).abs());
            if (by - expected).abs() > slack || sent * way <= 0.0 {
                wrong.push(format!("{name} moves by {by:.3} instead of {expected:.3}"));
            }
        }
        velocities.values_mut()[k] *= -1.0;
        for tick in 0..TICKS + 20 {
            bench.command(limb, if tick < TICKS { &velocities } else { &still })?;
            bench.wait(PERIOD)?;
        }
    }
    let measured = if wrong.is_empty() { format!("off by {worst:.4} at worst") } else { wrong.join("; ") };
    Ok(Verdict::new(wrong.is_empty(), measured, "as sent within 20 % + 0.006 rad or m; all others within 0.02"))
}

pub(super) fn arm_follows(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    limb_follows(bench, Limb::Arm, 0.1)
}

pub(super) fn head_follows(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    limb_follows(bench, Limb::Head, 0.2)
}

pub(super) fn gripper_opens(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let most_m = bench.model.settings.gripper.max_aperture_m;
    let force_n = 0.5 * bench.model.settings.gripper.max_force_n;
    let mut worst_m: f64 = 0.0;
    for share in [0.9, 0.4] {
        bench.robot.gripper().command(share * most_m, force_n)?;
        for _ in 0..300 {
            bench.wait(PERIOD)?;
        }
        worst_m = worst_m.max((bench.robot.gripper().state()?.width_m - share * most_m).abs());
    }
    Ok(Verdict::new(worst_m <= 0.01, format!("off by {worst_m:.4} m"), "within 0.01 m after 3 s"))
}

pub(super) fn limits_are_told(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    const FAR: f64 = 50.0;
    const EPSILON: f64 = 1e-6;
    let base = &bench.model.settings.base;
    let mut beyond = Vec::new();
    for sign in [-FAR, FAR] {
        let sent = bench.robot.base().command(Twist { forward_m_per_s: sign, turn_rad_per_s: sign })?;
        // No time passes before the next command.
        bench.robot.base().command(Twist::default())?;
        if sent.forward_m_per_s.abs() > base.max_speed_m_per_s + EPSILON
            || sent.turn_rad_per_s.abs() > base.max_turn_rate_rad_per_s + EPSILON
        {
            beyond.push(format!("base {sent:?}"));
        }
        for limb in [Limb::Arm, Limb::Head] {
            let group = bench.group(limb);
            let mut velocities = JointVelocities::zeros(&group.joints);
            velocities.values_mut().fill(sign);
            let sent = bench.command(limb, &velocities)?;
            bench.command(limb, &JointVelocities::zeros(&group.joints))?;
            let over = sent.iter().zip(&group.limits).find(|((_, v), limits)| v.abs() > limits.velocity + EPSILON);
            beyond.extend(over.map(|((name, velocity), _)| format!("{name} at {velocity}")));
        }
    }
    let gripper = &bench.model.settings.gripper;
    let (width_m, force_n) = bench.robot.gripper().command(FAR, 100.0 * FAR)?;
    if width_m > gripper.max_aperture_m + EPSILON || force_n > gripper.max_force_n + EPSILON {
        beyond.push(format!("gripper at {width_m} m and {force_n} N"));
    }
    let measured = if beyond.is_empty() { "all within".to_owned() } else { beyond.join("; ") };
    Ok(Verdict::new(beyond.is_empty(), measured, "the answers are within robot.toml and the URDF"))
}

pub(super) fn nonsense_is_refused(bench: &mut Bench<'_>) -> Result<Verdict, DriverError> {
    let before = (bench.positions(Limb::Arm)?, bench.robot.localisation().odom_from_base()?.pose);
    let mut taken = Vec::new();
    let broken = Twist { forward_m_per_s: f64::NAN, turn_rad_per_s: 0.0 };
    if !matches!(bench.robot.base().command(broken), Err(DriverError::NotFinite { .. })) {
        taken.push("a base speed that is not a number");
    }
    let mut velocities = JointVelocities::zeros(&bench.model.arm.joints);
    velocities.values_mut()[0] = f64::INFINITY;
    if !matches!(bench.robot.arm().command(&velocities), Err(DriverError::NotFinite { .. })) {
        taken.push("an infinite joint speed");
    }
    let mut turned = bench.model.arm.joints.to_vec();
    turned.reverse();
    let turned = JointVelocities::zeros(&turned.into());
    if !matches!(bench.robot.arm().command(&turned), Err(DriverError::WrongJoints { .. })) {
        taken.push("joints in another order");
    }
    for _ in 0..20 {
        bench.wait(PERIOD)?;
    }
    let after = (bench.positions(Limb::Arm)?, bench.robot.localisation().odom_from_base()?.pose);
    let most = before.0.values().iter().zip(after.0.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let moved = most.max(before.1.inv_mul(&after.1).translation.vector.norm());
    let measured = if taken.is_empty() { "all refused".to_owned() } else { format!("taken: {}", taken.join(", ")) };
    let passed = taken.is_empty() && moved < 0.01;
    Ok(Verdict::new(passed, format!("{measured}; moved by {moved:.4}"), "all refused; moved by less than 0.01"))
}
