//! Contract: each fault of a scene is found and named with its line, and a sound scene passes.
use super::*;

fn check(inner: &str, semantics: Option<&str>) -> CheckedScene {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = format!("<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\"/>\n{inner}</worldbody></mujoco>");
    std::fs::write(folder.path().join("scene.xml"), text).expect("written");
    if let Some(semantics) = semantics {
        std::fs::write(folder.path().join("semantics.toml"), semantics).expect("written");
    }
    check_scene(folder.path(), RobotSize::default()).expect("loads")
}

const START: &str = "version = 1\nname = \"t\"\n[start]\nareas = [{ x_m = -1, y_m = 0 }]\n";

fn boxed(name: &str, x_m: f64, z_m: f64, joint: &str) -> String {
    format!(
        "<body name=\"{name}\" pos=\"{x_m} 0 {z_m}\">{joint}<geom type=\"box\" size=\".1 .1 .1\" mass=\"1\"/></body>\n"
    )
}

fn free(name: &str, x_m: f64, z_m: f64) -> String {
    boxed(name, x_m, z_m, "<freejoint/>")
}

#[test]
fn a_sound_scene_has_no_findings() {
    let semantics = format!("{START}[[object]]\nbody = \"a\"\ncategory = \"box\"\n");
    let checked = check(&free("a", 0.0, 0.1), Some(&semantics));
    assert_eq!((checked.findings, checked.free_bodies, checked.categories), (vec![], 1, 1));
}

#[test]
fn overlapping_falling_and_unlisted_bodies_are_named_with_their_lines() {
    let inner = free("a", 0.0, 0.1) + &free("b", 0.15, 0.1) + &free("c", 2.0, 0.5);
    let text: Vec<String> = check(&inner, Some(START)).findings.iter().map(ToString::to_string).collect();
    assert!(text.iter().any(|t| t.contains("scene.xml:2: `a` overlaps `b` by 50.0 mm")), "{text:?}");
    assert!(text.iter().any(|t| t.contains("scene.xml:4: `c` moves 4")), "{text:?}");
    assert_eq!(text.iter().filter(|t| t.ends_with("is not listed in semantics.toml")).count(), 3);
}

#[test]
fn fixed_bodies_that_reach_into_each_other_are_named_once() {
    let inner = boxed("a", 0.0, 0.1, "") + &boxed("b", 0.15, 0.1, "") + &boxed("c", 0.39, 0.1, "");
    let findings = check(&inner, Some(START)).findings;
    let overlaps: Vec<&Finding> =
        findings.iter().map(|f| &f.finding).filter(|f| matches!(f, Finding::Overlap { .. })).collect();
    assert_eq!(overlaps.len(), 1, "b and c overlap by a centimetre, which is construction: {overlaps:?}");
    assert!(matches!(overlaps[0], Finding::Overlap { body, other, .. } if body == "a" && other == "b"));
}

#[test]
fn held_joints_are_listed_and_missing_start_areas_are_named() {
    let door = "<body name=\"door\"><joint name=\"h\" type=\"ball\"/><geom size=\".1\" pos=\"0 0 1\"/></body>";
    let checked = check(door, None);
    let held: Vec<_> = checked.held_joints().map(|note| (note.name.as_deref(), note.line)).collect();
    assert_eq!(held, [(Some("h"), Some(2))]);
    assert!(checked.findings.iter().any(|f| f.finding == Finding::NoStartArea));
}

#[test]
fn a_room_behind_a_narrow_gap_is_unreachable_and_one_behind_a_doorway_is_not() {
    // A wall along y at x = 0 with a gap of 0.5 m or 0.8 m, a fence around both rooms.
    for (gap_m, expected) in [(0.5, 1), (0.8, 0)] {
        let half = 0.5 * (1.5 - 0.5 * gap_m);
        let at = 0.5 * gap_m + half;
        let mut inner = String::new();
        for (pos, size) in [
            (format!("0 {at} 1"), format!(".05 {half} 1")),
            (format!("0 -{at} 1"), format!(".05 {half} 1")),
            ("0 1.55 1".to_owned(), "2.1 .05 1".to_owned()),
            ("0 -1.55 1".to_owned(), "2.1 .05 1".to_owned()),
            ("2.05 0 1".to_owned(), ".05 1.5 1".to_owned()),
            ("-2.05 0 1".to_owned(), ".05 1.5 1".to_owned()),
        ] {
            inner.push_str(&format!("<geom type=\"box\" pos=\"{pos}\" size=\"{size}\"/>\n"));
        }
        let rooms = "[[room]]\nname = \"west\"\npolygon = [[-2, -1.5], [-0.05, -1.5], [-0.05, 1.5], [-2, 1.5]]\n\
                     [[room]]\nname = \"east\"\npolygon = [[0.05, -1.5], [2, -1.5], [2, 1.5], [0.05, 1.5]]\n";
        let findings = check(&inner, Some(&format!("{START}{rooms}"))).findings;
        assert_eq!(findings.len(), expected, "{findings:?}");
        if let Some(finding) = findings.first() {
            assert!(finding.to_string().contains("semantics.toml:9: room `east` cannot be reached"), "{finding}");
        }
    }
}
