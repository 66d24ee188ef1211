//! A scene while it is being made: bodies of simple shapes, what they are, walls, rooms and lights.

use super::finish::Finish;

/// A solid centred at its geom's position; axis of revolution along z. Metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// Half extents.
    Box([f64; 3]),
    /// Radius and half length.
    Cylinder(f64, f64),
    /// Radius.
    Sphere(f64),
    /// Radii.
    Ellipsoid([f64; 3]),
}

impl Shape {
    /// Volume in cubic metres, to share a body's mass out.
    pub(super) fn volume_m3(self) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Box([x, y, z]) => 8.0 * x * y * z,
            Self::Cylinder(radius, half) => 2.0 * PI * radius * radius * half,
            Self::Sphere(radius) => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Ellipsoid([x, y, z]) => 4.0 / 3.0 * PI * x * y * z,
        }
    }
}

/// One geom in its body's frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Geom {
    pub shape: Shape,
    pub at_m: [f64; 3],
    /// Euler angles x, y, z in radians.
    pub turn_rad: [f64; 3],
    pub finish: Finish,
    /// Drawn, never touched.
    pub visual: bool,
}

/// Geoms are collected with one call per solid.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Geoms(pub Vec<Geom>);

impl Geoms {
    /// A solid.
    pub(super) fn add(&mut self, shape: Shape, at_m: [f64; 3], finish: Finish) -> &mut Geom {
        self.0.push(Geom { shape, at_m, turn_rad: [0.0; 3], finish, visual: false });
        let last = self.0.len() - 1;
        &mut self.0[last]
    }

    /// A box from its middle and half extents.
    pub(super) fn cuboid(&mut self, at_m: [f64; 3], half_m: [f64; 3], finish: Finish) -> &mut Geom {
        self.add(Shape::Box(half_m), at_m, finish)
    }

    /// An upright cylinder from its middle, radius and half height.
    pub(super) fn cylinder(&mut self, at_m: [f64; 3], radius_m: f64, half_m: f64, finish: Finish) -> &mut Geom {
        self.add(Shape::Cylinder(radius_m, half_m), at_m, finish)
    }

    /// Four legs under the corners of a rectangle, from the floor up to `top_m`.
    pub(super) fn legs(&mut self, half_m: [f64; 2], thick_m: f64, top_m: f64, finish: Finish) {
        for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let at = [x * (half_m[0] - thick_m), y * (half_m[1] - thick_m), 0.5 * top_m];
            self.cuboid(at, [thick_m, thick_m, 0.5 * top_m], finish);
        }
    }
}

/// A door or a drawer: a part of a body that a joint moves.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    /// `door_1`, `drawer_2`, ...
    pub name: String,
    pub joint: Joint,
    /// Where its frame lies in the body, metres.
    pub at_m: [f64; 3],
    /// The front first, then its handle.
    pub geoms: Geoms,
    /// What it takes to move it, where that is as in real furniture.
    pub feel: Option<Feel>,
}

/// What it takes to move a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Feel {
    /// Dry friction of the joint, newtons or newton metres.
    pub friction: f64,
    /// Damping, newtons or newton metres for each unit of speed.
    pub damping: f64,
    /// What its solids weigh, kg/m^3.
    pub kg_per_m3: f64,
}

/// How a part moves; travel begins closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Joint {
    /// About the vertical through the part's frame; radians, left or right.
    Hinge { open_rad: f64 },
    /// Along the body's -y; metres.
    Slide { open_m: f64 },
}

/// Half ranges by which a run's seed moves a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moves {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

/// What a body is, for evaluation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Meaning {
    pub category: String,
    pub finish: Finish,
    /// Whether `finish` states what it is made of; a colour by the seed alone does not.
    pub material_known: bool,
    /// Where it is known.
    pub mass_kg: Option<f64>,
    pub affordances: Vec<String>,
    pub moves: Option<Moves>,
    /// Made of something that its category usually is not.
    pub unusual: bool,
}

/// One body.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Body {
    pub name: String,
    pub at_m: [f64; 3],
    pub yaw_rad: f64,
    /// Whether it can be moved.
    pub free: bool,
    pub geoms: Geoms,
    pub parts: Vec<Part>,
    pub meaning: Meaning,
}

/// A room's outline, metres.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoomOutline {
    pub name: String,
    pub outline: Rect,
}

/// A scene before it is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Draft {
    pub name: String,
    /// First line of both files: how it was made.
    pub origin: String,
    /// Floors and walls: name and geom.
    pub shell: Vec<(String, Geom)>,
    pub bodies: Vec<Body>,
    pub rooms: Vec<RoomOutline>,
    /// Middles and half sides, metres.
    pub starts: Vec<([f64; 2], f64)>,
}

/// A rectangle along the axes of the floor, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub min: [f64; 2],
    pub max: [f64; 2],
}

impl Rect {
    pub(super) fn around(center: [f64; 2], half: [f64; 2]) -> Self {
        Self { min: [center[0] - half[0], center[1] - half[1]], max: [center[0] + half[0], center[1] + half[1]] }
    }

    pub(super) fn center(&self) -> [f64; 2] {
        [0.5 * (self.min[0] + self.max[0]), 0.5 * (self.min[1] + self.max[1])]
    }

    pub(super) fn size(&self) -> [f64; 2] {
        [self.max[0] - self.min[0], self.max[1] - self.min[1]]
    }

    pub(super) fn area_m2(&self) -> f64 {
        let [x, y] = self.size();
        x * y
    }

    pub(super) fn grown(&self, by_m: f64) -> Self {
        Self { min: self.min.map(|v| v - by_m), max: self.max.map(|v| v + by_m) }
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        (0..2).all(|i| self.min[i] < other.max[i] && other.min[i] < self.max[i])
    }

    pub(super) fn holds(&self, other: &Self) -> bool {
        (0..2).all(|i| self.min[i] <= other.min[i] + 1e-9 && other.max[i] <= self.max[i] + 1e-9)
    }

    /// Distance to a point, 0 inside.
    pub(super) fn distance_m(&self, point: [f64; 2]) -> f64 {
        let away = |i: usize| (self.min[i] - point[i]).max(point[i] - self.max[i]).max(0.0);
        away(0).hypot(away(1))
    }
}

/// A point of a body's frame in the world.
pub(super) fn turned(at: [f64; 2], yaw_rad: f64, point: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = yaw_rad.sin_cos();
    [at[0] + cos * point[0] - sin * point[1], at[1] + sin * point[0] + cos * point[1]]
}
