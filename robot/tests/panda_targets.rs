//! The controller on the 500 Panda targets of the evaluation data.

mod panda;

use dsm_robot::control::ControlStatus;
use panda::Panda;

/// Local controllers from home, without restarts, reach 88.2 % (mink, pink) and 87.8 % (NEO) of these targets without
/// acceleration limits; ours keeps the data sheet's.
#[test]
// The message is how a reader of the test's output learns what was measured, or that nothing was.
#[allow(clippy::print_stderr)]
fn at_least_85_of_100_panda_targets_are_reached_and_no_tick_brakes() {
    let Some(panda) = Panda::find() else {
        eprintln!("skipped: DSM_DATA does not name the folder with panda_ik_targets.json");
        return;
    };
    let mut controller = panda.controller(Panda::config());
    let (mut reached, mut ticks, mut braking) = (0_usize, 0_usize, 0_usize);
    for target in &panda.targets {
        let success = panda.run(&mut controller, target, |output| {
            ticks += 1;
            braking += usize::from(matches!(output.status, ControlStatus::Braking { .. }));
        });
        reached += usize::from(success);
    }
    eprintln!("{reached} of {} targets, {ticks} ticks, {braking} braking", panda.targets.len());
    assert!(reached * 100 >= 85 * panda.targets.len(), "{reached}");
    assert_eq!(braking, 0);
}
