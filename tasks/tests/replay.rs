//! Contract: a recorded run replays to the same commands, decisions and map, bit for bit, without its world; whatever is
//! changed in its recording is told with part and moment; a recording that is killed, cut or bounded replays up to there; a
//! regression test of it runs from its folder.

#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;

use bench::Bench;
use dsm::time::Stamp;
use dsm_robot::recorded::Answers;
use dsm_tasks::mcap_file::{create_run, open_run};
use dsm_tasks::replay::{Differing, Entry, PlayOptions, ReplayReport, Sight, Wanted, play, read_table};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn good(bench: &Bench, args: &[&str], code: i32) -> String {
    let output = bench.run(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn replayed(path: &Path) -> ReplayReport {
    play(&|wanted| open_run(path, wanted), PlayOptions { sight: Sight::Recorded }).unwrap().report
}

/// Copies a recording with changes; entries for which nothing is given back are left out.
fn copy(from: &Path, to: &Path, mut change: impl FnMut(Entry) -> Option<Entry>) {
    let (mut source, mut file) = (open_run(from, Wanted::All).unwrap(), create_run(to).unwrap());
    while let Some(entry) = source.next_entry().unwrap() {
        if let Some(entry) = change(entry) {
            file.put(&entry).unwrap();
        }
    }
    file.finish().unwrap();
}

/// The simulated second at which something is changed.
const AT: Stamp = Stamp(4_000_000_000);

#[test]
fn a_recorded_check_of_drivers_finds_the_same_again() {
    let bench = Bench::new();
    let check = |more: &[&str], code| {
        good(&bench, &[&["drivers", "check", "--freedom", "stand", "--json"], more].concat(), code)
    };
    let live = check(&["--scene", "scene.xml", "--record", "check.mcap"], 0);
    assert_eq!(check(&["--recording", "check.mcap"], 0), live);
    // Another check asks something else, which is an error and no finding.
    let other = ["drivers", "check", "--recording", "check.mcap"];
    let output = bench.run(&other);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("check.mcap") && said.contains("--freedom"), "{said}");
}

#[test]
fn a_recorded_run_replays_to_the_same() {
    let bench = Bench::new();
    let path = |name: &str| bench.path().join(name);
    // Nine seconds are not enough to grasp: the run fails, its recording is whole.
    let run = ["run", "episode.toml", "--time-limit-s", "9"];
    good(&bench, &[&run[..], &["--out", "plain"]].concat(), 1);
    good(&bench, &[&run[..], &["--out", "run", "--record", "run.mcap"]].concat(), 1);
    for file in ["map.dsm", "summary.json"] {
        let read = |folder: &str| fs::read(path(folder).join(file)).unwrap();
        assert!(read("plain") == read("run"), "recording changes {file}");
    }
    let report = good(&bench, &["replay", "run.mcap", "--out", "replay", "--json", "--as-test", "test"], 0);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!((&report["identical"], &report["reached_end"]), (&Value::Bool(true), &Value::Bool(true)), "{report}");
    let count = |key: &str| report[key].as_u64().unwrap();
    assert!(count("commands") > 1500 && count("frames") > 30 && count("events") > 1 && count("steps") == 1, "{report}");
    assert!(fs::read(path("run/map.dsm")).unwrap() == fs::read(path("replay/map.dsm")).unwrap(), "the maps differ");

    // The folder is a test of its own, for which a change of what is expected fails.
    assert!(good(&bench, &["replay", "test"], 0).contains("identical"));
    let expected = fs::read_to_string(path("test/replay.toml")).unwrap();
    fs::write(path("test/replay.toml"), expected.replacen("step 0: Grasp", "step 0: Drop", 1)).unwrap();
    assert!(good(&bench, &["replay", "test"], 1).contains("expected: step 0: Drop the apple"));
    fs::write(path("test/replay.toml"), expected.replacen("recording_digest = \"", "recording_digest = \"0", 1))
        .unwrap();
    good(&bench, &["replay", "test"], 2);

    // The segmenter sees other things in the same pixels: the map differs from the first frame on.
    let pixels = good(&bench, &["replay", "run.mcap", "--detector", "pixels"], 1);
    assert!(pixels.contains("Map differs first"), "{pixels}");

    numbers_are_those_of_the_periods(&bench);
    changes_are_located(&bench);
    cuts_replay_up_to_there(&bench);
}

fn numbers_are_those_of_the_periods(bench: &Bench) {
    let open = || open_run(&bench.path().join("run.mcap"), Wanted::AllButFrames).unwrap();
    let table = read_table(&mut *open()).unwrap();
    let column = |name: &str| table.columns.iter().position(|column| column == name).unwrap();
    let rows: Vec<&[f64]> = table.values.chunks(table.columns.len()).collect();
    let (mut source, mut periods) = (open(), 0);
    while let Some(entry) = source.next_entry().unwrap() {
        let Entry::Period(period) = entry else { continue };
        let row = rows[periods];
        periods += 1;
        assert_eq!(row[column("now_s")], period.now.as_s());
        let at = period.world_from_base.find(0).map(|answer| answer.as_ref().unwrap().pose.translation.x);
        assert_eq!(row[column("base.x_m")].to_bits(), at.unwrap_or(f64::NAN).to_bits());
        let sent = period.head.commands.last().map(|exchange| exchange.answer.as_ref().unwrap());
        let names = table.head.head_joints.iter().map(|name| name.as_str().into()).collect();
        let sent = sent.map(|sent| sent.find_velocities(&names).unwrap().values()[0]);
        let name = format!("sent.{}.velocity", table.head.head_joints[0]);
        assert_eq!(row[column(&name)].to_bits(), sent.unwrap_or(f64::NAN).to_bits());
    }
    assert_eq!((periods, periods > 800), (rows.len(), true));
    assert_eq!(table.end.unwrap().steps.len(), 1);
}

fn changes_are_located(bench: &Bench) {
    let (run, changed) = (bench.path().join("run.mcap"), bench.path().join("changed.mcap"));
    let differs = |change: &mut dyn FnMut(Entry) -> Option<Entry>| {
        let _ = fs::remove_file(&changed);
        copy(&run, &changed, change);
        let report = replayed(&changed);
        assert!(!report.identical, "{report:?}");
        report.first_difference.unwrap()
    };
    let _ = fs::remove_file(&changed);
    copy(&run, &changed, Some);
    assert!(replayed(&changed).identical, "a copy is the same");

    // A command.
    let found = differs(&mut |mut entry| {
        if let Entry::Period(period) = &mut entry
            && period.now == AT
        {
            period.head.commands.clear();
        }
        Some(entry)
    });
    assert_eq!((found.of, found.part.as_str(), found.stamp_s), (Differing::Command, "head", AT.as_s()), "{found:?}");
    assert_eq!(found.expected, "no further command");

    // A pose: the next frame is seen from elsewhere.
    let found = differs(&mut |mut entry| {
        if let Entry::Frame(frame) = &mut entry
            && frame.stamp == AT
        {
            frame.world_from_camera.translation.x += 1e-3;
        }
        Some(entry)
    });
    assert_eq!((found.of, found.stamp_s), (Differing::Map, AT.as_s()), "{found:?}");

    // What localisation said: the head turns a little otherwise, or what is decided.
    let found = differs(&mut |mut entry| {
        if let Entry::Period(period) = &mut entry
            && period.now >= AT
            && let Some(Ok(mut answer)) = period.world_from_base.find(0).cloned()
        {
            let mut answers = Answers::default();
            answer.pose.translation.x += 0.4;
            answers.note(Ok(answer));
            period.world_from_base = answers;
        }
        Some(entry)
    });
    assert!((AT.as_s()..AT.as_s() + 1.0).contains(&found.stamp_s), "{found:?}");

    // A detection.
    let mut frame = None;
    let found = differs(&mut |mut entry| {
        if let Entry::Learnt(learnt) = &mut entry
            && learnt.stamp >= AT
            && frame.is_none()
            && let Some(largest) = learnt.detections.items.iter_mut().max_by_key(|item| item.mask.area())
        {
            largest.score *= 0.5;
            largest.name = "toaster".into();
            frame = Some(learnt.stamp);
        }
        Some(entry)
    });
    assert_eq!((found.of, found.stamp_s), (Differing::Map, frame.unwrap().as_s()), "{found:?}");

    // An event.
    let found = differs(&mut |entry| match entry {
        Entry::Noted(mut noted) if noted.what.starts_with("step 0:") => {
            noted.what = "step 0: Dance".into();
            Some(Entry::Noted(noted))
        }
        other => Some(other),
    });
    assert_eq!((found.of, found.expected.as_str()), (Differing::Decision, "at 0.00 s: step 0: Dance"), "{found:?}");

    // The final map.
    let found = differs(&mut |mut entry| {
        if let Entry::End(end) = &mut entry {
            end.map.pop();
        }
        Some(entry)
    });
    assert_eq!((found.of, found.part.as_str()), (Differing::Map, "final map"), "{found:?}");
}

fn cuts_replay_up_to_there(bench: &Bench) {
    let (run, cut) = (bench.path().join("run.mcap"), bench.path().join("cut.mcap"));
    let whole = fs::read(&run).unwrap();
    for share in [0.3, 0.77, 0.99] {
        fs::write(&cut, &whole[..(share * whole.len() as f64) as usize]).unwrap();
        let report = replayed(&cut);
        assert!(report.identical && !report.notices.is_empty(), "{share}: {report:?}");
        assert!(report.sim_time_s > 9.0 * share - 2.0, "{share}: {report:?}");
    }
    // What is damaged in the middle is said to be.
    let mut damaged = whole.clone();
    damaged[whole.len() / 2] ^= 0x40;
    fs::write(&cut, &damaged).unwrap();
    let output = bench.run(&["replay", "cut.mcap"]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    fs::write(&cut, "no recording").unwrap();
    assert_eq!(bench.run(&["replay", "cut.mcap"]).status.code(), Some(2));
    // A bound ends the recording and not the run.
    let args = ["run", "episode.toml", "--time-limit-s", "4", "--record", "bounded.mcap", "--record-max-mb", "3"];
    let output = bench.run(&args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("the recording is full"), "{said}");
    let bounded = bench.path().join("bounded.mcap");
    assert!(fs::metadata(&bounded).unwrap().len() < 9 << 20);
    let report = replayed(&bounded);
    assert!(report.identical && !report.reached_end && report.periods > 10, "{report:?}");
    // Nothing is written over.
    assert_eq!(bench.run(&[&args[..], &["--force"]].concat()).status.code(), Some(2));
}
