use super::*;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize, JsonSchema, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
struct Car {
    /// Version of the format.
    #[schemars(range(min = 1, max = 1))]
    version: u32,
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 9.0))]
    speed_m_per_s: Option<f64>,
    colour: Colour,
    #[serde(default)]
    wheel: Vec<Wheel>,
    #[serde(default)]
    seats: BTreeMap<String, Seat>,
    #[serde(default)]
    expect: Vec<Expect>,
}

#[derive(Deserialize, JsonSchema, Debug, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Colour {
    /// Red.
    Red,
    DarkBlue,
}

#[derive(Deserialize, JsonSchema, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
struct Wheel {
    #[schemars(range(min = 0.01))]
    radius_m: f64,
    #[schemars(length(equal = 3))]
    #[serde(default = "axis")]
    axis: [f64; 3],
}

fn axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

#[derive(Deserialize, JsonSchema, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
struct Seat {
    height_m: f64,
}

#[derive(Deserialize, JsonSchema, Debug, PartialEq)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Expect {
    RobotNear {
        #[schemars(range(min = 0.0))]
        within_m: f64,
    },
    Refused {},
}

fn message(text: &str) -> String {
    parse_toml::<Car>(text, Path::new("car.toml")).expect_err("the text is broken").to_string()
}

#[test]
fn a_valid_file_parses_to_its_values() {
    let text = "version = 1\ncolour = \"dark-blue\"\nspeed_m_per_s = 3\n[[wheel]]\nradius_m = 0.1\n[seats.left]\nheight_m = 0.4\n[[expect]]\nkind = \"robot_near\"\nwithin_m = 1.0\n[[expect]]\nkind = \"refused\"\n";
    let car: Car = parse_toml(text, Path::new("car.toml")).expect("valid");
    assert_eq!(car.wheel[0].radius_m, 0.1);
    assert_eq!(car.seats["left"].height_m, 0.4);
    assert_eq!(car.expect, vec![Expect::RobotNear { within_m: 1.0 }, Expect::Refused {}]);
}

#[test]
fn a_misspelt_key_is_named_with_line_and_nearest_key_at_every_depth() {
    let head = "version = 1\ncolour = \"red\"\n";
    let text = message(&format!("{head}sped_m_per_s = 1"));
    assert!(text.starts_with("car.toml:3: unknown key `sped_m_per_s`; did you mean `speed_m_per_s`?"), "{text}");
    let text = message(&format!("{head}[[wheel]]\nradius = 1.0"));
    assert!(text.starts_with("car.toml:4: unknown key `wheel[0].radius`; did you mean `radius_m`?"), "{text}");
    let text = message(&format!("{head}[seats.left]\nheigth_m = 1.0"));
    assert!(text.starts_with("car.toml:4: unknown key `seats.left.heigth_m`; did you mean `height_m`?"), "{text}");
    let text = message(&format!("{head}[[expect]]\nkind = \"robot_near\"\nwithin = 1.0"));
    assert!(text.starts_with("car.toml:5: unknown key `expect[0].within`; did you mean `within_m`?"), "{text}");
}

#[test]
fn a_value_out_of_range_is_named_with_line_and_range() {
    assert_eq!(
        message("version = 1\ncolour = \"red\"\nspeed_m_per_s = 10"),
        "car.toml:3: `speed_m_per_s` is 10; expected >= 0 and <= 9"
    );
    assert_eq!(message("version = 2\ncolour = \"red\""), "car.toml:1: `version` is 2; expected >= 1 and <= 1");
    let text = message("version = 1\ncolour = \"red\"\n[[wheel]]\nradius_m = nan");
    assert_eq!(text, "car.toml:4: `wheel[0].radius_m` is nan; expected >= 0.01");
    let text = message("version = 1\ncolour = \"red\"\n[[wheel]]\nradius_m = 0.2\naxis = [1.0]");
    assert_eq!(text, "car.toml:5: `wheel[0].axis` is [1.0]; expected 3 values");
}

#[test]
fn a_wrong_word_lists_the_words() {
    let text = message("version = 1\ncolour = \"drak-blue\"");
    assert_eq!(
        text,
        "car.toml:2: `colour` is \"drak-blue\"; expected one of dark-blue, red (did you mean `dark-blue`?)"
    );
    let text = message("version = 1\ncolour = \"red\"\n[[expect]]\nkind = \"robot_nar\"");
    assert!(text.starts_with("car.toml:4: `expect[0].kind` is \"robot_nar\"; expected one of robot_near"), "{text}");
}

#[test]
fn broken_syntax_wrong_types_and_missing_keys_name_a_line() {
    assert!(message("version = 1\ncolour = ").starts_with("car.toml:2: "));
    let text = message("version = 1\ncolour = \"red\"\nspeed_m_per_s = \"fast\"");
    assert!(text.starts_with("car.toml:3: ") && text.contains("expected f64"), "{text}");
    let text = message("version = 1");
    assert!(text.contains("missing field `colour`"), "{text}");
}
