//! Builders of furniture. Each draws sizes and returns a piece in its own frame, front towards -y. Metres.

use super::draft::{Geom, Shape};
use super::finish::{Color, Finish, Material};
use super::piece::{OPEN_SKY_M, Piece, Top};
use super::{Draws, draw_of};
use rand::RngExt;

const STEEL: Finish = Finish::plain(Material::Metal, Color::Gray);
const BLACK: Finish = Finish::plain(Material::Plastic, Color::Black);
const WHITE: Finish = Finish::plain(Material::Plastic, Color::White);
const SHEET: Finish = Finish::plain(Material::Fabric, Color::White);
const DARK: Finish =
    Finish { material: Material::Plastic, color: Color::Black, pattern: super::finish::Pattern::Plain, shade: 2 };

fn between(rng: &mut Draws, low: f64, high: f64) -> f64 {
    // Whole centimetres: sizes as people buy them.
    (100.0 * rng.random_range(low..=high)).round() / 100.0
}

/// A piece of the category; `None` for what is no furniture.
pub(super) fn build_piece(category: &str, finish: Finish, rng: &mut Draws) -> Option<Piece> {
    Some(match category {
        "sofa" => seat(between(rng, 1.4, 1.9), between(rng, 0.78, 0.86), finish, 2),
        "armchair" => seat(between(rng, 0.72, 0.82), between(rng, 0.72, 0.8), finish, 1),
        "ottoman" => cushion_block(between(rng, 0.45, 0.6), between(rng, 0.38, 0.44), finish),
        "chair" => chair(between(rng, 0.4, 0.44), between(rng, 0.43, 0.47), finish),
        "office chair" => office_chair(finish),
        "stool" => stool(between(rng, 0.15, 0.18), between(rng, 0.42, 0.62), finish),
        "bench" => bench(between(rng, 0.8, 1.1), finish),
        "bed" => bed(draw_of(&[0.9, 1.2, 1.4], rng), between(rng, 1.9, 2.0), finish),
        "table" => table([between(rng, 1.0, 1.25), between(rng, 0.62, 0.72)], between(rng, 0.7, 0.75), finish, rng),
        "dining table" => {
            table([between(rng, 1.2, 1.5), between(rng, 0.7, 0.78)], between(rng, 0.72, 0.75), finish, rng)
        }
        "coffee table" => {
            table([between(rng, 0.75, 0.95), between(rng, 0.45, 0.55)], between(rng, 0.4, 0.46), finish, rng)
        }
        "side table" => {
            table([between(rng, 0.42, 0.5), between(rng, 0.4, 0.45)], between(rng, 0.48, 0.58), finish, rng)
        }
        "desk" => desk(between(rng, 1.15, 1.4), finish),
        "nightstand" => chest([between(rng, 0.42, 0.5), 0.4], between(rng, 0.48, 0.56), 2, finish),
        "dresser" => chest([between(rng, 0.8, 1.1), 0.45], between(rng, 0.78, 0.9), 3, finish),
        "cabinet" => cabinet([between(rng, 0.6, 0.9), between(rng, 0.36, 0.42)], between(rng, 0.8, 1.05), finish),
        "wardrobe" => wardrobe(between(rng, 0.9, 1.2), between(rng, 1.85, 2.05), finish),
        "tv stand" => tv_stand(between(rng, 1.1, 1.4), finish),
        "shelf" => shelf(between(rng, 0.75, 1.0), 0.32, &[0.06, 0.37, between(rng, 0.78, 0.84)], finish),
        "bookshelf" => shelf(between(rng, 0.75, 0.95), 0.32, &[0.06, 0.38, 0.79, 1.2, 1.62], finish),
        "coat rack" => coat_rack(finish),
        "rug" => rug(between(rng, 1.3, 1.8), between(rng, 0.9, 1.3), finish),
        "fridge" => fridge(between(rng, 0.58, 0.66), between(rng, 1.6, 1.85), finish),
        "stove" => stove(finish),
        "countertop" => counter(between(rng, 1.1, 1.5), finish, rng),
        "sink" => sink(finish),
        "toilet" => toilet(finish),
        "bathtub" => bathtub(between(rng, 1.5, 1.65), finish),
        "washing machine" => washing_machine(finish),
        "trash can" => bin(between(rng, 0.11, 0.15), between(rng, 0.32, 0.45), finish),
        "laundry basket" => bin(between(rng, 0.18, 0.22), between(rng, 0.5, 0.6), finish),
        "box" => cushion_block(between(rng, 0.4, 0.55), between(rng, 0.3, 0.4), finish),
        "floor lamp" => floor_lamp(finish, rng),
        "plant" => plant(between(rng, 0.85, 1.3), finish, rng),
        _ => return None,
    })
}

fn seat(width: f64, depth: f64, finish: Finish, cushions: usize) -> Piece {
    let (hx, hy) = (0.5 * width, 0.5 * depth);
    let mut piece = Piece::new([hx, hy], 0.8);
    let g = &mut piece.geoms;
    g.cuboid([0.0, 0.0, 0.18], [hx, hy, 0.18], finish);
    g.cuboid([0.0, hy - 0.1, 0.58], [hx, 0.1, 0.22], finish);
    for side in [-1.0, 1.0] {
        g.cuboid([side * (hx - 0.09), -0.1, 0.47], [0.09, hy - 0.1, 0.11], finish);
    }
    let inner = width - 0.36;
    let each = inner / cushions as f64;
    for i in 0..cushions {
        let x = -0.5 * inner + each * (i as f64 + 0.5);
        g.cuboid([x, -0.1, 0.39], [0.5 * each - 0.005, hy - 0.11, 0.03], finish);
    }
    piece
}

fn cushion_block(width: f64, height: f64, finish: Finish) -> Piece {
    let half = 0.5 * width;
    let mut piece = Piece::new([half, half], height);
    piece.geoms.cuboid([0.0, 0.0, 0.5 * height], [half, half, 0.5 * height], finish);
    piece
}

fn chair(width: f64, seat: f64, finish: Finish) -> Piece {
    let h = 0.5 * width;
    let mut piece = Piece::new([h, h], seat + 0.45);
    piece.geoms.legs([h, h], 0.015, seat - 0.04, finish);
    piece.geoms.cuboid([0.0, 0.0, seat - 0.02], [h, h, 0.02], finish);
    piece.geoms.cuboid([0.0, h - 0.015, seat + 0.225], [h, 0.015, 0.225], finish);
    piece
}

fn office_chair(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.27, 0.25], 0.98);
    let g = &mut piece.geoms;
    g.cylinder([0.0, 0.0, 0.03], 0.24, 0.03, BLACK);
    g.cylinder([0.0, 0.0, 0.24], 0.03, 0.18, STEEL);
    g.cuboid([0.0, 0.0, 0.455], [0.22, 0.22, 0.035], finish);
    g.cuboid([0.0, 0.2, 0.76], [0.21, 0.025, 0.22], finish);
    for side in [-1.0, 1.0] {
        g.cuboid([side * 0.24, 0.02, 0.6], [0.025, 0.14, 0.015], BLACK);
        g.cuboid([side * 0.24, 0.02, 0.52], [0.015, 0.02, 0.065], BLACK);
    }
    piece
}

fn stool(radius: f64, height: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([radius + 0.02; 2], height);
    piece.geoms.cylinder([0.0, 0.0, height - 0.02], radius, 0.02, finish);
    piece.geoms.cylinder([0.0, 0.0, 0.5 * height], 0.025, 0.5 * height - 0.03, STEEL);
    piece.geoms.cylinder([0.0, 0.0, 0.0125], radius + 0.02, 0.0125, STEEL);
    piece
}

fn bench(width: f64, finish: Finish) -> Piece {
    let hx = 0.5 * width;
    let mut piece = Piece::new([hx, 0.18], 0.45);
    piece.geoms.cuboid([0.0, 0.0, 0.43], [hx, 0.18, 0.02], finish);
    for side in [-1.0, 1.0] {
        piece.geoms.cuboid([side * (hx - 0.07), 0.0, 0.205], [0.025, 0.16, 0.205], finish);
    }
    piece.with_top(0.01, true)
}

fn bed(width: f64, length: f64, finish: Finish) -> Piece {
    let (hx, hy) = (0.5 * width, 0.5 * length);
    let cover = Finish::plain(
        Material::Fabric,
        [Color::Blue, Color::Red, Color::Green, Color::Gray][(100.0 * length) as usize % 4],
    );
    let mut piece = Piece::new([hx, hy], 0.5);
    let g = &mut piece.geoms;
    g.cuboid([0.0, 0.0, 0.15], [hx, hy, 0.15], finish);
    g.cuboid([0.0, -0.02, 0.39], [hx - 0.02, hy - 0.04, 0.09], SHEET);
    g.cuboid([0.0, hy - 0.02, 0.65], [hx, 0.02, 0.35], finish);
    g.cuboid([0.0, -0.3, 0.49], [hx - 0.015, hy - 0.33, 0.012], cover);
    piece.tops.push(Top {
        center: [0.0, hy - 0.32],
        half: [hx - 0.1, 0.2],
        z_m: 0.48,
        headroom_m: OPEN_SKY_M,
        open_around: false,
    });
    piece.height_m = 1.0;
    piece
}

fn table(size: [f64; 2], height: f64, finish: Finish, rng: &mut Draws) -> Piece {
    let half = size.map(|s| 0.5 * s);
    let legs = if finish.material == Material::Glass || rng.random::<f64>() < 0.25 { STEEL } else { finish };
    let mut piece = Piece::new(half, height);
    piece.geoms.cuboid([0.0, 0.0, height - 0.0175], [half[0], half[1], 0.0175], finish);
    piece.geoms.legs([half[0] - 0.03, half[1] - 0.03], 0.025, height - 0.035, legs);
    piece.with_top(0.0, true)
}

fn desk(width: f64, finish: Finish) -> Piece {
    let hx = 0.5 * width;
    let mut piece = Piece::new([hx, 0.33], 0.74);
    piece.geoms.cuboid([0.0, 0.0, 0.7225], [hx, 0.33, 0.0175], finish);
    piece.geoms.legs([hx - 0.02, 0.3], 0.025, 0.705, STEEL);
    // A hollow block of drawers at one side, under the top.
    let mut block = Piece::new([0.19, 0.27], 0.7);
    block.carcass(0.12, 0.68, 0.016, finish);
    block.drawers(3, 0.12, 0.68, finish, STEEL);
    let aside = hx - 0.28;
    piece.geoms.0.extend(block.geoms.0.into_iter().map(|geom| aside_by(geom, aside)));
    piece.parts = block
        .parts
        .into_iter()
        .map(|mut part| {
            part.at_m[0] += aside;
            part
        })
        .collect();
    piece.with_top(0.0, true)
}

fn aside_by(mut geom: Geom, x: f64) -> Geom {
    geom.at_m[0] += x;
    geom
}

fn chest(size: [f64; 2], height: f64, drawers: usize, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * size[0], 0.5 * size[1]], height);
    piece.carcass(0.05, height, 0.018, finish);
    plinth(&mut piece, finish);
    piece.drawers(drawers, 0.06, height - 0.02, finish, STEEL);
    piece.with_top(0.0, false)
}

fn plinth(piece: &mut Piece, finish: Finish) {
    let [hx, hy] = piece.half;
    piece.geoms.cuboid([0.0, 0.01, 0.025], [hx - 0.01, hy - 0.02, 0.025], finish);
}

fn cabinet(size: [f64; 2], height: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * size[0], 0.5 * size[1]], height);
    piece.carcass(0.05, height, 0.018, finish);
    plinth(&mut piece, finish);
    let board = 0.5 * height;
    let [hx, hy] = piece.half;
    piece.geoms.cuboid([0.0, 0.0, board], [hx - 0.018, hy - 0.012, 0.008], finish);
    piece.doors(2, 0.06, height - 0.02, finish, STEEL);
    piece.with_top(0.0, false)
}

fn wardrobe(width: f64, height: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * width, 0.28], height);
    piece.carcass(0.05, height, 0.02, finish);
    plinth(&mut piece, finish);
    piece.doors(2, 0.06, height - 0.02, finish, STEEL);
    piece
}

fn tv_stand(width: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * width, 0.2], 0.5);
    piece.carcass(0.05, 0.5, 0.018, finish);
    plinth(&mut piece, finish);
    piece.doors(2, 0.06, 0.48, finish, STEEL);
    piece.with_top(0.0, false)
}

fn shelf(width: f64, depth: f64, boards: &[f64], finish: Finish) -> Piece {
    let ([hx, hy], last) = ([0.5 * width, 0.5 * depth], boards[boards.len() - 1]);
    let mut piece = Piece::new([hx, hy], last);
    for side in [-1.0, 1.0] {
        piece.geoms.cuboid([side * (hx - 0.0125), 0.0, 0.5 * last], [0.0125, hy, 0.5 * last], finish);
    }
    piece.geoms.cuboid([0.0, hy - 0.006, 0.5 * last], [hx - 0.025, 0.006, 0.5 * last], finish);
    for (index, top) in boards.iter().enumerate() {
        piece.geoms.cuboid([0.0, -0.006, top - 0.0125], [hx - 0.025, hy - 0.006, 0.0125], finish);
        let headroom = boards.get(index + 1).map_or(OPEN_SKY_M, |next| next - top - 0.025);
        let inset = if index + 1 == boards.len() { 0.0 } else { 0.03 };
        piece.tops.push(Top {
            center: [0.0, -0.006],
            half: [hx - inset, hy - 0.012],
            z_m: *top,
            headroom_m: headroom,
            open_around: false,
        });
    }
    piece
}

fn coat_rack(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.2, 0.2], 1.75);
    piece.geoms.cylinder([0.0, 0.0, 0.015], 0.2, 0.015, finish);
    piece.geoms.cylinder([0.0, 0.0, 0.89], 0.02, 0.86, finish);
    for turn in 0..3 {
        let angle = f64::from(turn) * std::f64::consts::FRAC_PI_3;
        let arm = piece.geoms.cuboid([0.0, 0.0, 1.6 + 0.05 * f64::from(turn)], [0.16, 0.01, 0.01], finish);
        arm.turn_rad = [0.0, 0.0, angle];
    }
    piece
}

fn rug(width: f64, depth: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * width, 0.5 * depth], 0.006);
    piece.geoms.cuboid([0.0, 0.0, 0.003], [0.5 * width, 0.5 * depth, 0.003], finish).visual = true;
    piece
}

fn fridge(width: f64, height: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([0.5 * width, 0.32], height);
    piece.carcass(0.02, height, 0.04, finish);
    let split = 0.36 * height;
    piece.geoms.cuboid([0.0, 0.0, split], [0.5 * width - 0.04, 0.3, 0.02], finish);
    piece.doors(1, 0.03, split, finish, DARK);
    piece.doors(1, split, height - 0.01, finish, DARK);
    piece
}

fn stove(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.3, 0.3], 0.9);
    let g = &mut piece.geoms;
    g.cuboid([0.0, 0.0, 0.44], [0.3, 0.3, 0.44], finish);
    g.cuboid([0.0, 0.0, 0.89], [0.3, 0.3, 0.01], DARK);
    for (x, y) in [(-0.14, -0.13), (-0.14, 0.13), (0.14, -0.13), (0.14, 0.13)] {
        g.cylinder([x, y, 0.9015], 0.085, 0.0015, STEEL).visual = true;
    }
    g.cuboid([0.0, -0.303, 0.42], [0.25, 0.003, 0.2], DARK).visual = true;
    g.cuboid([0.0, -0.315, 0.7], [0.23, 0.01, 0.01], STEEL).visual = true;
    for x in [-0.2, -0.07, 0.06, 0.19] {
        let knob = g.add(Shape::Cylinder(0.02, 0.01), [x, -0.31, 0.8], BLACK);
        (knob.turn_rad, knob.visual) = ([std::f64::consts::FRAC_PI_2, 0.0, 0.0], true);
    }
    piece.tops.push(Top {
        center: [0.0, 0.13],
        half: [0.2, 0.1],
        z_m: 0.903,
        headroom_m: OPEN_SKY_M,
        open_around: false,
    });
    piece
}

fn counter(width: f64, top: Finish, rng: &mut Draws) -> Piece {
    let front = Finish::draw(Material::Wood, &[Color::White, Color::Brown, Color::Beige], rng);
    let mut piece = Piece::new([0.5 * width, 0.28], 0.9);
    piece.carcass(0.05, 0.86, 0.018, front);
    plinth(&mut piece, front);
    piece.doors(2, 0.06, 0.66, front, STEEL);
    piece.drawers(1, 0.67, 0.85, front, STEEL);
    piece.half[1] = 0.3;
    piece.geoms.cuboid([0.0, 0.0, 0.88], [0.5 * width, 0.3, 0.02], top);
    piece.with_top(0.0, false)
}

fn sink(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.3, 0.28], 0.88);
    piece.carcass(0.05, 0.7, 0.018, WHITE);
    plinth(&mut piece, WHITE);
    piece.doors(2, 0.06, 0.69, WHITE, STEEL);
    piece.half[1] = 0.3;
    let g = &mut piece.geoms;
    // A basin: bottom and four rims around a hollow.
    g.cuboid([0.0, 0.0, 0.72], [0.3, 0.3, 0.02], finish);
    g.cuboid([0.0, 0.23, 0.82], [0.3, 0.07, 0.08], finish);
    g.cuboid([0.0, -0.27, 0.82], [0.3, 0.03, 0.08], finish);
    for side in [-1.0, 1.0] {
        g.cuboid([side * 0.27, -0.04, 0.82], [0.03, 0.2, 0.08], finish);
    }
    g.cylinder([0.0, 0.22, 1.0], 0.014, 0.1, STEEL);
    g.cuboid([0.0, 0.14, 1.09], [0.012, 0.09, 0.012], STEEL);
    piece.height_m = 1.1;
    piece
}

fn toilet(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.2, 0.33], 0.78);
    let g = &mut piece.geoms;
    g.cuboid([0.0, 0.23, 0.56], [0.19, 0.09, 0.2], finish);
    g.cylinder([0.0, -0.12, 0.2], 0.15, 0.2, finish);
    g.cuboid([0.0, 0.12, 0.2], [0.12, 0.2, 0.2], finish);
    g.cylinder([0.0, -0.12, 0.415], 0.2, 0.015, finish);
    piece
}

fn bathtub(length: f64, finish: Finish) -> Piece {
    let (hx, hy) = (0.5 * length, 0.36);
    let mut piece = Piece::new([hx, hy], 0.55);
    let g = &mut piece.geoms;
    g.cuboid([0.0, 0.0, 0.08], [hx, hy, 0.08], finish);
    for side in [-1.0, 1.0] {
        g.cuboid([0.0, side * (hy - 0.035), 0.355], [hx, 0.035, 0.195], finish);
        g.cuboid([side * (hx - 0.045), 0.0, 0.355], [0.045, hy - 0.07, 0.195], finish);
    }
    g.cuboid([hx - 0.045, 0.0, 0.62], [0.02, 0.02, 0.07], STEEL);
    g.cuboid([hx - 0.1, 0.0, 0.68], [0.07, 0.015, 0.012], STEEL);
    piece
}

fn washing_machine(finish: Finish) -> Piece {
    let mut piece = Piece::new([0.3, 0.28], 0.85);
    piece.geoms.cuboid([0.0, 0.0, 0.425], [0.3, 0.28, 0.425], finish);
    for (radius, depth, finish) in [(0.19, 0.012, STEEL), (0.14, 0.018, DARK)] {
        let door = piece.geoms.add(Shape::Cylinder(radius, depth), [0.0, -0.28, 0.45], finish);
        (door.turn_rad, door.visual) = ([std::f64::consts::FRAC_PI_2, 0.0, 0.0], true);
    }
    piece.geoms.cuboid([0.0, -0.282, 0.78], [0.27, 0.004, 0.04], BLACK).visual = true;
    piece.with_top(0.0, false)
}

/// A hollow bin of eight staves.
fn bin(radius: f64, height: f64, finish: Finish) -> Piece {
    let mut piece = Piece::new([radius; 2], height);
    piece.geoms.cylinder([0.0, 0.0, 0.01], radius - 0.01, 0.01, finish);
    let apothem = radius * (std::f64::consts::PI / 8.0).cos() - 0.006;
    for i in 0..8 {
        let angle = f64::from(i) * std::f64::consts::FRAC_PI_4;
        let (sin, cos) = angle.sin_cos();
        let half = [0.006, apothem * (std::f64::consts::PI / 8.0).tan() + 0.002, 0.5 * height - 0.01];
        let stave = piece.geoms.cuboid([apothem * cos, apothem * sin, 0.5 * height + 0.01], half, finish);
        stave.turn_rad = [0.0, 0.0, angle];
    }
    piece
}

fn floor_lamp(finish: Finish, rng: &mut Draws) -> Piece {
    let shade =
        Finish::plain(Material::Fabric, draw_of(&[Color::White, Color::Beige, Color::Orange, Color::Green], rng));
    let height = between(rng, 1.4, 1.6);
    let mut piece = Piece::new([0.16; 2], height);
    piece.geoms.cylinder([0.0, 0.0, 0.0125], 0.13, 0.0125, finish);
    piece.geoms.cylinder([0.0, 0.0, 0.5 * height], 0.012, 0.5 * height - 0.05, finish);
    piece.geoms.cylinder([0.0, 0.0, height - 0.12], 0.16, 0.12, shade);
    piece
}

fn plant(height: f64, finish: Finish, rng: &mut Draws) -> Piece {
    let pot = Finish::draw(Material::Ceramic, &[Color::Brown, Color::White, Color::Gray, Color::Orange], rng);
    let wood = Finish::plain(Material::Wood, Color::Brown);
    let radius = 0.13;
    let mut piece = Piece::new([0.2; 2], height);
    let g = &mut piece.geoms;
    g.cylinder([0.0, 0.0, 0.13], radius, 0.13, pot);
    g.cylinder([0.0, 0.0, 0.263], radius - 0.015, 0.003, wood).visual = true;
    g.cylinder([0.0, 0.0, 0.26 + 0.2 * height], 0.014, 0.2 * height, wood);
    let crown = 0.5 * (height - 0.42);
    g.add(Shape::Ellipsoid([0.18, 0.18, crown]), [0.0, 0.0, height - crown], finish);
    for side in [-1.0, 1.0] {
        let at = [side * 0.08, side * 0.05, height - (1.0 - 0.3 * side) * crown];
        g.add(Shape::Ellipsoid([0.11, 0.11, 0.6 * crown]), at, finish).visual = true;
    }
    piece
}
