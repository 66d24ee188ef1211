//! Contract: the interval is Wilson's; stages, skills and figures are summed; JUnit is XML whatever a reason holds.
use super::*;

fn line(id: &str, stage: Option<Stage>, spl: Option<f64>) -> SuiteEpisode {
    let metrics = Metrics {
        sim_time_s: 10.0,
        path_length_m: 2.0,
        shortest_path_m: spl.map(|_| 1.0),
        spl,
        soft_spl: spl,
        known_map_spl: None,
        collisions: u32::from(stage.is_some()),
        others_touched: u32::from(stage.is_some()),
        min_clearance_m: Some(0.1),
        limit_violations: 0,
        contact_force_max_n: 0.0,
        person_contact_max_m_per_s: None,
        non_target_displacement_max_m: 0.06,
    };
    SuiteEpisode {
        id: id.to_owned(),
        seed: 1,
        success: stage.is_none(),
        failed_stage: stage,
        reason: stage.map(|_| "a < b & \"c\"\u{1}\nd".to_owned()),
        metrics: Some(metrics),
        skill: Some("grasp".to_owned()),
        disturbances: Vec::new(),
        parts: None,
    }
}

#[test]
fn wilson_interval_of_nine_in_ten() {
    // Value from R: binom::binom.wilson(9, 10).
    let [low, high] = wilson(9, 10);
    assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
}

#[test]
fn sums_count_each_episode_once() {
    let crashed = SuiteEpisode::without_metrics("c", 2, Stage::Crash, "boom".into());
    let suite = Suite::new(vec![line("a", None, Some(0.5)), line("b", Some(Stage::Hold), Some(0.0)), crashed]);
    let t = &suite.totals;
    assert_eq!((t.episodes, t.successes, t.collisions), (3, 1, 1));
    assert_eq!((t.failed_stages["hold"].count, t.failed_stages["crash"].count), (1, 1));
    assert_eq!((t.by_skill["grasp"].count, t.by_skill["grasp"].of), (1, 2));
    assert_eq!((t.spl, t.with_displacement.count, t.with_others_touched.count), (Some(0.25), 2, 1));
    assert!(!suite.all_succeed() && suite.table().contains("failed in hold"));
}

#[test]
fn what_explores_first_is_weighed_by_its_last_step_alone() {
    let mut explored = line("b", None, Some(0.05));
    explored.metrics.as_mut().unwrap().known_map_spl = Some(0.9);
    let t = Suite::new(vec![line("a", None, Some(0.5)), explored]).totals;
    assert_eq!((t.spl, t.soft_spl, t.known_map_spl), (Some(0.5), Some(0.5), Some(0.9)));
    assert_eq!((t.with_known_map.count, t.with_known_map.of), (1, 1));
}

#[test]
fn junit_is_well_formed() {
    let crashed = SuiteEpisode::without_metrics("c<1>", 2, Stage::Crash, "boom".into());
    let text = Suite::new(vec![line("a", None, None), line("b", Some(Stage::Hold), None), crashed]).junit();
    assert!(text.contains("tests=\"3\" failures=\"1\" errors=\"1\" time=\"20.00\""), "{text}");
    assert!(text.contains("message=\"a &lt; b &amp; &quot;c&quot; d\""), "{text}");
    assert!(text.contains("classname=\"c&lt;1&gt;\"") && text.contains("<error type=\"crash\""), "{text}");
}

#[test]
fn recovery_is_a_success_that_broke_and_hurt_nothing() {
    let disturbed = |id: &str, stage, force_n: f64, person: Option<f64>| {
        let mut line = SuiteEpisode { disturbances: vec!["person".into()], ..line(id, stage, None) };
        let metrics = line.metrics.as_mut().unwrap();
        (metrics.contact_force_max_n, metrics.person_contact_max_m_per_s) = (force_n, person);
        line
    };
    let lines = vec![
        disturbed("a", None, 59.0, Some(0.05)),
        disturbed("b", None, 61.0, None),
        disturbed("c", None, 0.0, Some(0.2)),
        disturbed("d", Some(Stage::Hold), 0.0, None),
        line("e", None, None),
    ];
    let suite = Suite::new(lines);
    let person = &suite.totals.by_disturbance["person"];
    assert_eq!((person.recovered.count, person.recovered.of, person.succeeded.count), (1, 4, 3));
    assert_eq!((person.with_hard_contact.count, person.with_person_hurt.count), (1, 1));
    assert!(suite.table().contains("after person"));
}

#[test]
fn sequences_count_parts_and_what_is_said_of_them() {
    let with = |id: &str, done: usize, untrue: usize| SuiteEpisode {
        parts: Some(Parts { parts: 3, done, untrue }),
        ..line(id, (done < 3).then_some(Stage::Sequence), None)
    };
    let suite = Suite::new(vec![with("a", 3, 0), with("b", 2, 0), with("c", 1, 1), line("d", None, None)]);
    let sequences = suite.totals.sequences.as_ref().unwrap();
    assert_eq!((sequences.complete.count, sequences.complete.of), (1, 3));
    assert_eq!((sequences.parts.count, sequences.parts.of, sequences.truthful.count), (6, 9, 2));
    assert!(suite.table().contains("accounts true 2 of 3"));
}
