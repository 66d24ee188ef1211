//! Builders of the things that stand on furniture or hang on walls: origin at the middle of the underside (hung things:
//! at their middle, back to +y), front towards -y. Metres.

use super::Draws;
use super::draft::{Geoms, Shape};
use super::finish::{Color, Finish, Material, Pattern};
use rand::RngExt;
use std::f64::consts::FRAC_PI_2;

const STEEL: Finish = Finish::plain(Material::Metal, Color::Gray);
const BLACK: Finish = Finish::plain(Material::Plastic, Color::Black);
const PAPER: Finish = Finish { material: Material::Paper, color: Color::White, pattern: Pattern::Plain, shade: 1 };
const GREEN: Finish = Finish::plain(Material::Organic, Color::Green);
const SCREEN: Finish = Finish { material: Material::Glass, color: Color::Black, pattern: Pattern::Plain, shade: 0 };
const INSIDE: Finish = Finish { material: Material::Plastic, color: Color::Brown, pattern: Pattern::Plain, shade: 1 };

/// A thing as its builder hands it over.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Thing {
    pub geoms: Geoms,
    /// Half sides of its footprint.
    pub half: [f64; 2],
    pub height_m: f64,
    /// Whether any heading suits it; else it faces about forward.
    pub any_heading: bool,
}

impl Thing {
    fn new(half: [f64; 2], height_m: f64) -> Self {
        Self { half, height_m, ..Self::default() }
    }

    fn round(radius: f64, height_m: f64) -> Self {
        Self { half: [radius; 2], height_m, any_heading: true, ..Self::default() }
    }
}

fn around(rng: &mut Draws, value: f64, share: f64) -> f64 {
    value * (1.0 + share * (2.0 * rng.random::<f64>() - 1.0))
}

/// A thing that a hand can take: at most 0.11 m across where it is held, at most 0.3 m high.
pub(super) fn build_graspable(category: &str, finish: Finish, rng: &mut Draws) -> Option<Thing> {
    Some(match category {
        "apple" => fruit(around(rng, 0.037, 0.08), true, finish),
        "orange" => fruit(around(rng, 0.038, 0.08), false, finish),
        "lemon" => fruit(around(rng, 0.03, 0.08), false, finish),
        "tomato" => fruit(around(rng, 0.034, 0.1), true, finish),
        "ball" => fruit(around(rng, 0.042, 0.2), false, finish),
        "mug" => mug(around(rng, 0.04, 0.08), around(rng, 0.095, 0.1), finish),
        "cup" => vessel(around(rng, 0.036, 0.08), around(rng, 0.075, 0.12), finish),
        "glass" => vessel(around(rng, 0.034, 0.08), around(rng, 0.12, 0.12), finish),
        "pen holder" => vessel(around(rng, 0.038, 0.08), around(rng, 0.1, 0.1), finish),
        "bowl" => bowl(around(rng, 0.054, 0.04), finish),
        "plate" => plate(around(rng, 0.095, 0.1), finish),
        "bottle" => bottle(around(rng, 0.034, 0.08), around(rng, 0.23, 0.1), finish),
        "wine bottle" => bottle(around(rng, 0.037, 0.04), around(rng, 0.28, 0.05), finish),
        "shampoo" => bottle(around(rng, 0.033, 0.08), around(rng, 0.19, 0.1), finish),
        "can" => can(around(rng, 0.033, 0.06), around(rng, 0.115, 0.1), finish),
        "jar" => can(around(rng, 0.04, 0.08), around(rng, 0.11, 0.12), finish),
        "thermos" => thermos(around(rng, 0.036, 0.06), around(rng, 0.24, 0.1), finish),
        "candle" => candle(around(rng, 0.032, 0.12), around(rng, 0.12, 0.2), finish),
        "milk carton" => carton([0.036, 0.036], around(rng, 0.2, 0.08), finish),
        "cereal box" => cereal_box(around(rng, 0.085, 0.1), around(rng, 0.26, 0.08), finish),
        "book" => book(rng, finish),
        "vase" => vase(around(rng, 0.046, 0.08), around(rng, 0.22, 0.12), finish),
        "toy block" => block([around(rng, 0.03, 0.12); 3], finish),
        "toy car" => toy_car(finish),
        "teddy bear" => teddy(finish),
        "alarm clock" => alarm_clock(finish),
        "tissue box" => tissue_box(finish),
        "soap dispenser" => dispenser(around(rng, 0.034, 0.08), around(rng, 0.13, 0.1), finish),
        "sponge" => block([0.05, 0.034, 0.0225], finish),
        "toilet paper" => roll(finish),
        "flower pot" => vessel(around(rng, 0.05, 0.06), around(rng, 0.1, 0.1), finish),
        _ => return None,
    })
}

/// A thing that stays where it is.
pub(super) fn build_fixture(category: &str, finish: Finish, rng: &mut Draws) -> Option<Thing> {
    Some(match category {
        "tv" => screen_on_foot(around(rng, 0.48, 0.1), 0.28, 0.14, finish),
        "monitor" => screen_on_foot(0.28, 0.165, 0.1, finish),
        "keyboard" => keyboard(finish),
        "laptop" => laptop(finish),
        "printer" => appliance([0.21, 0.17, 0.1], false, finish),
        "microwave" => appliance([0.24, 0.17, 0.14], true, finish),
        "toaster" => appliance([0.14, 0.09, 0.095], false, finish),
        "coffee machine" => coffee_machine(finish),
        "kettle" => kettle(finish),
        "pot" => pot(finish),
        "lamp" => lamp(finish),
        "pillow" => pillow(finish),
        "picture" => picture(rng, finish),
        "mirror" => mirror(rng, finish),
        "clock" => clock(finish),
        _ => return None,
    })
}

fn fruit(radius: f64, stalk: bool, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, 2.0 * radius + 0.001);
    thing.geoms.add(Shape::Sphere(radius), [0.0, 0.0, radius + 0.001], finish);
    // A flattened underside, so that it does not roll.
    thing.geoms.cylinder([0.0, 0.0, 0.003], 0.36 * radius, 0.003, finish);
    if stalk {
        thing.geoms.cylinder([0.002, 0.0, 2.0 * radius + 0.003], 0.0025, 0.006, GREEN).visual = true;
    }
    thing
}

fn vessel(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    thing.geoms.cylinder([0.0, 0.0, 0.5 * height], radius, 0.5 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, height + 0.0005], radius - 0.004, 0.0005, INSIDE).visual = true;
    thing
}

fn mug(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = vessel(radius, height, finish);
    let (x, middle) = (radius + 0.022, 0.5 * height);
    thing.geoms.cuboid([x, 0.0, middle], [0.005, 0.006, 0.25 * height], finish);
    for side in [-1.0, 1.0] {
        thing.geoms.cuboid([radius + 0.01, 0.0, middle + side * 0.25 * height], [0.015, 0.006, 0.005], finish);
    }
    thing.half = [radius + 0.027; 2];
    thing
}

fn bowl(radius: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, 0.055);
    for (share, low, high) in [(0.55, 0.0, 0.0166), (0.82, 0.0166, 0.036), (1.0, 0.036, 0.055)] {
        thing.geoms.cylinder([0.0, 0.0, 0.5 * (low + high)], share * radius, 0.5 * (high - low), finish);
    }
    thing.geoms.cylinder([0.0, 0.0, 0.0555], 0.9 * radius, 0.0005, INSIDE).visual = true;
    thing
}

fn plate(radius: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, 0.022);
    thing.geoms.cylinder([0.0, 0.0, 0.006], 0.6 * radius, 0.006, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.017], radius, 0.005, finish);
    thing
}

fn bottle(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    let body = 0.64 * height;
    let cap = Finish { color: if finish.color == Color::White { Color::Blue } else { Color::White }, ..BLACK };
    thing.geoms.cylinder([0.0, 0.0, 0.5 * body], radius, 0.5 * body, finish);
    thing.geoms.add(Shape::Ellipsoid([radius, radius, 0.1 * height]), [0.0, 0.0, body], finish).visual = true;
    thing.geoms.cylinder([0.0, 0.0, body + 0.16 * height], 0.42 * radius, 0.16 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.98 * height], 0.5 * radius, 0.02 * height, cap);
    thing
}

fn can(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    thing.geoms.cylinder([0.0, 0.0, 0.5 * height], radius, 0.5 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, height + 0.0005], 0.9 * radius, 0.0005, STEEL).visual = true;
    thing
}

fn thermos(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    thing.geoms.cylinder([0.0, 0.0, 0.4 * height], radius, 0.4 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.9 * height], 0.8 * radius, 0.1 * height, BLACK);
    thing
}

fn candle(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    thing.geoms.cylinder([0.0, 0.0, 0.5 * height], radius, 0.5 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, height + 0.006], 0.0015, 0.006, BLACK).visual = true;
    thing
}

fn carton(half: [f64; 2], height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::new(half, height);
    let body = 0.86 * height;
    thing.geoms.cuboid([0.0, 0.0, 0.5 * body], [half[0], half[1], 0.5 * body], finish);
    thing.geoms.cuboid([0.0, 0.0, 0.93 * height], [half[0], 0.35 * half[1], 0.07 * height], finish);
    thing
}

fn cereal_box(half_x: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::new([half_x, 0.03], height);
    let label =
        Finish::plain(Material::Cardboard, if finish.color == Color::Yellow { Color::Blue } else { Color::Yellow });
    thing.geoms.cuboid([0.0, 0.0, 0.5 * height], [half_x, 0.03, 0.5 * height], finish);
    for side in [-1.0, 1.0] {
        let at = [0.0, side * 0.0304, 0.56 * height];
        thing.geoms.cuboid(at, [0.6 * half_x, 0.0004, 0.2 * height], label).visual = true;
    }
    thing
}

fn book(rng: &mut Draws, finish: Finish) -> Thing {
    let (width, length, thick) = (around(rng, 0.05, 0.12), around(rng, 0.08, 0.12), around(rng, 0.019, 0.2));
    let mut thing = if rng.random::<bool>() {
        let mut upright = Thing::new([thick, width + 0.012], 2.0 * length + 0.02);
        let half_z = length + 0.01;
        upright.geoms.cuboid([0.0, 0.0, half_z], [thick, width + 0.012, half_z], finish);
        upright.geoms.cuboid([0.0, 0.004, half_z], [thick - 0.004, width + 0.0085, half_z + 0.0005], PAPER).visual =
            true;
        upright
    } else {
        let mut lying = Thing::new([width, length], 2.0 * thick);
        lying.geoms.cuboid([0.0, 0.0, thick], [width, length, thick], finish);
        lying.geoms.cuboid([0.004, 0.0, thick], [width - 0.0035, length + 0.0005, thick - 0.004], PAPER).visual = true;
        lying
    };
    thing.any_heading = false;
    thing
}

fn vase(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height);
    let neck = 0.55 * radius;
    thing.geoms.cylinder([0.0, 0.0, 0.03 * height], 0.75 * radius, 0.03 * height, finish);
    thing.geoms.add(Shape::Ellipsoid([radius, radius, 0.3 * height]), [0.0, 0.0, 0.33 * height], finish);
    thing.geoms.cylinder([0.0, 0.0, 0.78 * height], neck, 0.19 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.985 * height], 1.25 * neck, 0.015 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, height + 0.0005], neck, 0.0005, INSIDE).visual = true;
    thing
}

fn block(half: [f64; 3], finish: Finish) -> Thing {
    let mut thing = Thing::new([half[0], half[1]], 2.0 * half[2]);
    thing.geoms.cuboid([0.0, 0.0, half[2]], half, finish);
    thing
}

fn toy_car(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.035, 0.07], 0.075);
    thing.geoms.cuboid([0.0, 0.0, 0.031], [0.03, 0.07, 0.018], finish);
    thing.geoms.cuboid([0.0, 0.01, 0.062], [0.026, 0.035, 0.013], finish);
    thing.geoms.cuboid([0.0, 0.0, 0.0065], [0.024, 0.055, 0.0065], BLACK);
    for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let wheel = thing.geoms.add(Shape::Cylinder(0.015, 0.005), [x * 0.029, y * 0.043, 0.0155], BLACK);
        (wheel.turn_rad, wheel.visual) = ([0.0, FRAC_PI_2, 0.0], true);
    }
    thing
}

fn teddy(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.055, 0.05], 0.2);
    thing.geoms.cuboid([0.0, 0.0, 0.055], [0.045, 0.035, 0.055], finish);
    thing.geoms.add(Shape::Sphere(0.043), [0.0, 0.0, 0.15], finish);
    for side in [-1.0, 1.0] {
        thing.geoms.add(Shape::Sphere(0.015), [side * 0.033, 0.0, 0.185], finish).visual = true;
        thing.geoms.add(Shape::Ellipsoid([0.018, 0.018, 0.03]), [side * 0.045, -0.02, 0.075], finish).visual = true;
    }
    thing.geoms.add(Shape::Sphere(0.006), [0.0, -0.042, 0.147], BLACK).visual = true;
    thing
}

fn alarm_clock(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.055, 0.03], 0.1);
    thing.geoms.cuboid([0.0, 0.0, 0.05], [0.055, 0.03, 0.05], finish);
    let face = thing.geoms.add(Shape::Cylinder(0.038, 0.001), [0.0, -0.0305, 0.05], PAPER);
    (face.turn_rad, face.visual) = ([FRAC_PI_2, 0.0, 0.0], true);
    thing
}

fn tissue_box(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.055, 0.055], 0.11);
    thing.geoms.cuboid([0.0, 0.0, 0.055], [0.055, 0.055, 0.055], finish);
    thing.geoms.add(Shape::Ellipsoid([0.03, 0.012, 0.02]), [0.0, 0.0, 0.112], PAPER).visual = true;
    thing
}

fn dispenser(radius: f64, height: f64, finish: Finish) -> Thing {
    let mut thing = Thing::round(radius, height + 0.03);
    thing.geoms.cylinder([0.0, 0.0, 0.5 * height], radius, 0.5 * height, finish);
    thing.geoms.cylinder([0.0, 0.0, height + 0.0125], 0.008, 0.0125, STEEL);
    thing.geoms.cuboid([0.0, -0.012, height + 0.026], [0.007, 0.022, 0.004], STEEL);
    thing
}

fn roll(finish: Finish) -> Thing {
    let mut thing = Thing::round(0.05, 0.1);
    thing.geoms.cylinder([0.0, 0.0, 0.05], 0.05, 0.05, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.1005], 0.02, 0.0005, INSIDE).visual = true;
    thing
}

fn screen_on_foot(half_x: f64, half_z: f64, foot: f64, finish: Finish) -> Thing {
    let mut thing = Thing::new([half_x, 0.1], 2.0 * half_z + 0.1);
    let middle = 0.1 + half_z;
    thing.geoms.cuboid([0.0, 0.0, 0.01], [foot, 0.08, 0.01], BLACK);
    thing.geoms.cuboid([0.0, 0.045, 0.5 * middle], [0.03, 0.015, 0.5 * middle], BLACK);
    thing.geoms.cuboid([0.0, 0.03, middle], [half_x, 0.02, half_z], finish);
    thing.geoms.cuboid([0.0, 0.0095, middle], [half_x - 0.015, 0.0005, half_z - 0.015], SCREEN).visual = true;
    thing
}

fn keyboard(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.2, 0.07], 0.025);
    thing.geoms.cuboid([0.0, 0.0, 0.011], [0.2, 0.07, 0.011], finish);
    for row in -1..=2 {
        let at = [0.0, 0.03 * f64::from(row) - 0.015, 0.0225];
        thing.geoms.cuboid(at, [0.19, 0.011, 0.0015], STEEL).visual = true;
    }
    thing
}

fn laptop(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.16, 0.14], 0.23);
    thing.geoms.cuboid([0.0, -0.03, 0.01], [0.16, 0.11, 0.01], finish);
    thing.geoms.cuboid([0.0, -0.04, 0.021], [0.14, 0.055, 0.001], STEEL).visual = true;
    thing.geoms.cuboid([0.0, 0.095, 0.12], [0.16, 0.006, 0.11], finish).turn_rad = [-0.25, 0.0, 0.0];
    let screen = thing.geoms.cuboid([0.0, 0.0865, 0.122], [0.145, 0.001, 0.095], SCREEN);
    (screen.turn_rad, screen.visual) = ([-0.25, 0.0, 0.0], true);
    thing
}

fn appliance(half: [f64; 3], window: bool, finish: Finish) -> Thing {
    let mut thing = Thing::new([half[0], half[1]], 2.0 * half[2]);
    thing.geoms.cuboid([0.0, 0.0, half[2]], half, finish);
    let front = -half[1] - 0.002;
    if window {
        thing.geoms.cuboid([-0.25 * half[0], front, half[2]], [0.68 * half[0], 0.002, 0.78 * half[2]], SCREEN).visual =
            true;
        thing.geoms.cuboid([0.72 * half[0], front, half[2]], [0.2 * half[0], 0.002, 0.78 * half[2]], STEEL).visual =
            true;
    } else {
        thing.geoms.cuboid([0.0, front, half[2]], [0.7 * half[0], 0.002, 0.2 * half[2]], BLACK).visual = true;
        thing.geoms.cuboid([0.0, 0.0, 2.0 * half[2]], [0.7 * half[0], 0.3 * half[1], 0.002], BLACK).visual = true;
    }
    thing
}

fn coffee_machine(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.11, 0.14], 0.34);
    thing.geoms.cuboid([0.0, 0.0, 0.02], [0.11, 0.14, 0.02], finish);
    thing.geoms.cuboid([0.0, 0.08, 0.18], [0.11, 0.06, 0.14], finish);
    thing.geoms.cuboid([0.0, 0.0, 0.29], [0.11, 0.14, 0.05], finish);
    thing.geoms.cylinder([0.0, -0.05, 0.09], 0.055, 0.05, SCREEN);
    thing
}

fn kettle(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.115, 0.08], 0.2);
    thing.geoms.cylinder([0.0, 0.0, 0.09], 0.075, 0.09, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.19], 0.05, 0.01, BLACK);
    thing.geoms.cuboid([0.1, 0.0, 0.12], [0.01, 0.0125, 0.07], BLACK);
    thing.geoms.cuboid([0.08, 0.0, 0.18], [0.025, 0.0125, 0.01], BLACK);
    let spout = thing.geoms.cuboid([-0.088, 0.0, 0.14], [0.012, 0.012, 0.035], finish);
    spout.turn_rad = [0.0, -0.7, 0.0];
    thing
}

fn pot(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.15, 0.105], 0.18);
    thing.geoms.cylinder([0.0, 0.0, 0.07], 0.1, 0.07, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.145], 0.103, 0.005, finish);
    thing.geoms.add(Shape::Sphere(0.015), [0.0, 0.0, 0.165], BLACK);
    for side in [-1.0, 1.0] {
        thing.geoms.cuboid([side * 0.125, 0.0, 0.11], [0.025, 0.015, 0.006], BLACK);
    }
    thing
}

fn lamp(finish: Finish) -> Thing {
    let shade =
        Finish::plain(Material::Fabric, if finish.color == Color::White { Color::Orange } else { Color::Beige });
    let mut thing = Thing::round(0.105, 0.42);
    thing.geoms.cylinder([0.0, 0.0, 0.0125], 0.07, 0.0125, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.2], 0.012, 0.175, finish);
    thing.geoms.cylinder([0.0, 0.0, 0.35], 0.105, 0.07, shade);
    thing
}

fn pillow(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.26, 0.17], 0.11);
    thing.geoms.cuboid([0.0, 0.0, 0.035], [0.25, 0.16, 0.035], finish);
    thing.geoms.add(Shape::Ellipsoid([0.26, 0.17, 0.045]), [0.0, 0.0, 0.06], finish).visual = true;
    thing
}

fn picture(rng: &mut Draws, finish: Finish) -> Thing {
    let (half_x, half_z) = (around(rng, 0.32, 0.25), around(rng, 0.24, 0.2));
    let mut thing = Thing::new([half_x, 0.015], 2.0 * half_z);
    thing.geoms.cuboid([0.0, 0.0, 0.0], [half_x, 0.015, half_z], finish);
    thing.geoms.cuboid([0.0, -0.0155, 0.0], [half_x - 0.03, 0.0005, half_z - 0.03], PAPER).visual = true;
    // An abstract: a few fields of colour.
    for _ in 0..3 {
        let color = Finish::draw(Material::Paper, &[], rng);
        let (hx, hz) = (rng.random_range(0.05..0.45 * half_x), rng.random_range(0.04..0.45 * half_z));
        let x = (half_x - 0.035 - hx) * (2.0 * rng.random::<f64>() - 1.0);
        let z = (half_z - 0.035 - hz) * (2.0 * rng.random::<f64>() - 1.0);
        thing.geoms.cuboid([x, -0.0165, z], [hx, 0.0005 + 0.001 * rng.random::<f64>(), hz], color).visual = true;
    }
    thing
}

fn mirror(rng: &mut Draws, finish: Finish) -> Thing {
    let (half_x, half_z) = (around(rng, 0.28, 0.2), around(rng, 0.38, 0.2));
    let mut thing = Thing::new([half_x, 0.012], 2.0 * half_z);
    thing.geoms.cuboid([0.0, 0.0, 0.0], [half_x, 0.012, half_z], STEEL);
    thing.geoms.cuboid([0.0, -0.0125, 0.0], [half_x - 0.02, 0.0005, half_z - 0.02], finish).visual = true;
    thing
}

fn clock(finish: Finish) -> Thing {
    let mut thing = Thing::new([0.15, 0.015], 0.3);
    let ring = thing.geoms.add(Shape::Cylinder(0.15, 0.015), [0.0; 3], finish);
    ring.turn_rad = [FRAC_PI_2, 0.0, 0.0];
    let face = thing.geoms.add(Shape::Cylinder(0.13, 0.0005), [0.0, -0.0155, 0.0], PAPER);
    (face.turn_rad, face.visual) = ([FRAC_PI_2, 0.0, 0.0], true);
    thing.geoms.cuboid([0.0, -0.0165, 0.04], [0.004, 0.0005, 0.045], BLACK).visual = true;
    thing.geoms.cuboid([0.03, -0.0165, 0.0], [0.032, 0.0005, 0.004], BLACK).visual = true;
    thing
}
