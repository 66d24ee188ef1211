//! A piece of furniture as its builders hand it over.

use super::draft::{Geoms, Joint, Part};
use super::finish::Finish;

/// A level part on which things can stand, in the piece's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Top {
    pub center: [f64; 2],
    pub half: [f64; 2],
    pub z_m: f64,
    /// Free height above.
    pub headroom_m: f64,
    /// Whether it can be reached into from all sides, not from the front alone.
    pub open_around: bool,
}

/// A piece of furniture in its own frame: origin on the floor under its middle, front towards -y.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Piece {
    pub geoms: Geoms,
    pub parts: Vec<Part>,
    /// Half sides of its footprint.
    pub half: [f64; 2],
    pub height_m: f64,
    pub tops: Vec<Top>,
}

/// Free height above what nothing covers.
pub(super) const OPEN_SKY_M: f64 = 1.0;

impl Piece {
    pub(super) fn new(half: [f64; 2], height_m: f64) -> Self {
        Self { half, height_m, ..Self::default() }
    }

    /// Its whole upper side carries things.
    pub(super) fn with_top(mut self, inset_m: f64, open_around: bool) -> Self {
        let half = self.half.map(|h| h - inset_m);
        self.tops.push(Top { center: [0.0; 2], half, z_m: self.height_m, headroom_m: OPEN_SKY_M, open_around });
        self
    }

    /// A hollow carcass: sides, back, bottom and top of boards, open at the front.
    pub(super) fn carcass(&mut self, low_m: f64, high_m: f64, board_m: f64, finish: Finish) {
        let ([hx, hy], t) = (self.half, 0.5 * board_m);
        let (mid, half_z) = (0.5 * (low_m + high_m), 0.5 * (high_m - low_m));
        for side in [-1.0, 1.0] {
            self.geoms.cuboid([side * (hx - t), 0.0, mid], [t, hy, half_z], finish);
        }
        self.geoms.cuboid([0.0, hy - 0.006, mid], [hx - 2.0 * t, 0.006, half_z], finish);
        for z in [low_m + t, high_m - t] {
            self.geoms.cuboid([0.0, -0.006, z], [hx - 2.0 * t, hy - 0.006, t], finish);
        }
    }

    /// Doors side by side over a stretch of the front, each with a handle, hinged at the outer edges.
    pub(super) fn doors(&mut self, count: usize, low_m: f64, high_m: f64, front: Finish, handle: Finish) {
        let [hx, hy] = self.half;
        let width = 2.0 * hx / count as f64;
        for index in 0..count {
            let left = -hx + width * index as f64;
            let hinged_left = count == 1 || index % 2 == 0;
            let (hinge_x, inward) = if hinged_left { (left, 1.0) } else { (left + width, -1.0) };
            let half_z = 0.5 * (high_m - low_m) - 0.004;
            let mut geoms = Geoms::default();
            geoms.cuboid([inward * 0.5 * width, 0.0, 0.0], [0.5 * width - 0.003, 0.008, half_z], front);
            geoms.cuboid([inward * (width - 0.045), -0.022, 0.0], [0.008, 0.012, 0.07_f64.min(half_z)], handle);
            self.parts.push(Part {
                name: format!("door_{}", self.parts.len() + 1),
                joint: Joint::Hinge { open_rad: -inward * 1.7 },
                at_m: [hinge_x, -hy - 0.009, 0.5 * (low_m + high_m)],
                geoms,
                feel: None,
            });
        }
    }

    /// Drawers one above the other over a stretch of the front: open boxes with a front and a handle.
    pub(super) fn drawers(&mut self, count: usize, low_m: f64, high_m: f64, front: Finish, handle: Finish) {
        let [hx, hy] = self.half;
        let height = (high_m - low_m) / count as f64;
        for index in 0..count {
            let half_z = 0.5 * height - 0.004;
            let (inner_x, depth) = (hx - 0.035, hy - 0.02);
            let mut geoms = Geoms::default();
            geoms.cuboid([0.0, 0.0, 0.0], [hx - 0.003, 0.008, half_z], front);
            geoms.cuboid([0.0, -0.022, 0.0], [(0.4 * hx).min(0.09), 0.012, 0.008], handle);
            let wall = 0.6 * half_z;
            geoms.cuboid([0.0, depth, -half_z + 0.012], [inner_x, depth - 0.01, 0.004], front);
            for side in [-1.0, 1.0] {
                let at = [side * (inner_x - 0.004), depth, -half_z + 0.016 + wall];
                geoms.cuboid(at, [0.004, depth - 0.01, wall], front);
            }
            geoms.cuboid([0.0, 2.0 * depth - 0.016, -half_z + 0.016 + wall], [inner_x - 0.008, 0.004, wall], front);
            self.parts.push(Part {
                name: format!("drawer_{}", self.parts.len() + 1),
                joint: Joint::Slide { open_m: 1.2 * hy },
                at_m: [0.0, -hy - 0.009, low_m + height * (index as f64 + 0.5)],
                geoms,
                feel: None,
            });
        }
    }
}
