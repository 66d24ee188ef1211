//! From patches to things: which borders are no end of a thing.

use super::patches::{NONE, Patches};
use super::surface::{Surface, noise_m};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Pixel of no thing.
pub(super) const NOTHING: u32 = u32::MAX;
/// Share of a border at which the surface goes on.
const GOES_ON: f32 = 0.3;
/// Mean sine of the angle between the normals across a border from which it is no longer flat.
const FLAT: f32 = 0.12;
/// Length of a border, as a share of the square root of the smaller patch, from which it joins.
const LONG: f32 = 0.2;
/// Things with a smaller share of inner pixels are slivers: outlines and what is left between two patches.
const THIN: f32 = 0.5;
/// Things with fewer pixels are crumbs: parts of what they lie on, unless nothing goes on there.
const SMALL: f32 = 60.0;
/// Length at which the surface goes on, as a share of the square root of a sliver or crumb, from which it joins.
const CRUMB_LONG: f32 = 0.5;

/// How alike in colour two sides of a border must be to be one thing.
struct Likeness {
    /// Greatest difference of mean colour (CIELAB).
    most: f32,
    /// Weight of lightness: faces that are turned differently are lit differently.
    light: f32,
    /// How far chroma counts as it is, 0 to 1; the rest counts for its lightness, which shading scales as well.
    full: f32,
}

const ACROSS_FLAT: Likeness = Likeness { most: 20.0, light: 0.5, full: 1.0 };
const ACROSS_RIDGE: Likeness = Likeness { most: 45.0, light: 0.2, full: 0.3 };
const ACROSS_HOLLOW: Likeness = Likeness { most: 5.0, light: 0.5, full: 0.5 };

/// Things of an image.
pub(super) struct Joined {
    /// Number of its thing for each pixel, or [`NOTHING`].
    pub(super) thing_of: Vec<u32>,
    /// Numbers are below this one.
    pub(super) count: usize,
}

#[derive(Clone, Copy, Default)]
struct Part {
    size: f32,
    lab: [f32; 3],
}

#[derive(Clone, Copy)]
struct Border {
    length: f32,
    /// Pixels of it at which the surface goes on.
    continuous: f32,
    /// Sum of the bends there: positive for ridges.
    bend: f32,
    /// What joining costs, below 1; infinite when the border ends a thing.
    cost: f32,
}

impl Default for Border {
    fn default() -> Self {
        Self { length: 0.0, continuous: 0.0, bend: 0.0, cost: f32::INFINITY }
    }
}

/// Parts that become things.
struct Joining {
    parts: Vec<Part>,
    /// The part that each patch belongs to.
    owner: Vec<usize>,
    borders: BTreeMap<(usize, usize), Border>,
}

pub(super) fn join(surface: &Surface, patches: &Patches) -> Joined {
    let owner = (0..patches.count).collect();
    let mut joining = Joining { parts: measure(surface, patches), owner, borders: find_borders(surface, patches) };
    joining.join_alike();
    let slivers = joining.join_crumbs(surface, patches);
    let thing = |&patch: &u32| match patch {
        NONE => NOTHING,
        patch if slivers[joining.owner[patch as usize]] => NOTHING,
        patch => joining.owner[patch as usize] as u32,
    };
    Joined { thing_of: patches.patch_of.iter().map(thing).collect(), count: patches.count }
}

impl Joining {
    /// Joins what is most alike first, until all borders that are left end things.
    fn join_alike(&mut self) {
        let pairs: Vec<_> = self.borders.keys().copied().collect();
        pairs.into_iter().for_each(|pair| self.weigh(pair));
        loop {
            let best = self.borders.iter().min_by(|x, y| x.1.cost.total_cmp(&y.1.cost).then(x.0.cmp(y.0)));
            let Some((&(keep, go), _)) = best.filter(|(_, border)| border.cost < 1.0) else { return };
            self.absorb(keep, go);
        }
    }

    /// Gives slivers and crumbs to the neighbour into which they go on longest; marks the slivers that are left.
    fn join_crumbs(&mut self, surface: &Surface, patches: &Patches) -> Vec<bool> {
        let inner = self.count_inner(surface, patches);
        let mut parts: Vec<usize> = (0..self.parts.len()).filter(|part| self.owner[*part] == *part).collect();
        parts.sort_by(|a, b| self.parts[*a].size.total_cmp(&self.parts[*b].size));
        let mut slivers = vec![false; self.parts.len()];
        for part in parts {
            let size = self.parts[part].size;
            let is_sliver = inner[part] < THIN * size;
            if !is_sliver && size >= SMALL {
                continue;
            }
            let own = self.borders.iter().filter(|((a, b), _)| *a == part || *b == part);
            let on =
                own.filter(|(_, b)| b.continuous >= GOES_ON * b.length && b.continuous >= CRUMB_LONG * size.sqrt());
            let longest = on.max_by(|x, y| x.1.continuous.total_cmp(&y.1.continuous).then(y.0.cmp(x.0)));
            match longest.map(|((a, b), _)| if *a == part { *b } else { *a }) {
                Some(keep) => self.absorb(keep, part),
                None => slivers[part] = is_sliver,
            }
        }
        slivers
    }

    /// Pixels of each part whose four neighbours are of the same part.
    fn count_inner(&self, surface: &Surface, patches: &Patches) -> Vec<f32> {
        let columns = surface.columns;
        let part_of = |i: usize| match patches.patch_of[i] {
            NONE => None,
            patch => Some(self.owner[patch as usize]),
        };
        let mut inner = vec![0.0; self.parts.len()];
        for row in 1..surface.rows - 1 {
            for i in row * columns + 1..(row + 1) * columns - 1 {
                if let Some(part) = part_of(i)
                    && [i - 1, i + 1, i - columns, i + columns].into_iter().all(|j| part_of(j) == Some(part))
                {
                    inner[part] += 1.0;
                }
            }
        }
        inner
    }

    fn absorb(&mut self, keep: usize, go: usize) {
        let (a, b) = (self.parts[keep], self.parts[go]);
        let size = a.size + b.size;
        let lab = std::array::from_fn(|c| (a.lab[c] * a.size + b.lab[c] * b.size) / size);
        self.parts[keep] = Part { size, lab };
        self.owner.iter_mut().filter(|owner| **owner == go).for_each(|owner| *owner = keep);
        let moved: Vec<_> = self.borders.keys().filter(|(a, b)| *a == go || *b == go).copied().collect();
        for pair in moved {
            let Some(border) = self.borders.remove(&pair) else { continue };
            let other = if pair.0 == go { pair.1 } else { pair.0 };
            if other != keep {
                let entry = self.borders.entry((keep.min(other), keep.max(other))).or_default();
                entry.length += border.length;
                entry.continuous += border.continuous;
                entry.bend += border.bend;
            }
        }
        let changed: Vec<_> = self.borders.keys().filter(|(a, b)| *a == keep || *b == keep).copied().collect();
        changed.into_iter().for_each(|pair| self.weigh(pair));
    }

    /// Says what joining at a border costs.
    fn weigh(&mut self, pair: (usize, usize)) {
        let (a, b) = (self.parts[pair.0], self.parts[pair.1]);
        let Some(border) = self.borders.get_mut(&pair) else { return };
        let long = border.length >= LONG * a.size.min(b.size).sqrt();
        border.cost = f32::INFINITY;
        if long && border.continuous >= GOES_ON * border.length {
            let like = match border.bend / border.continuous.max(1.0) {
                bend if bend > FLAT => ACROSS_RIDGE,
                bend if bend < -FLAT => ACROSS_HOLLOW,
                _ => ACROSS_FLAT,
            };
            border.cost = like.difference(&a.lab, &b.lab) / like.most;
        }
    }
}

impl Likeness {
    fn difference(&self, a: &[f32; 3], b: &[f32; 3]) -> f32 {
        let tint = |lab: &[f32; 3], c: usize| lab[c] * (self.full + (1.0 - self.full) * 60.0 / lab[0].max(15.0));
        (self.light * (a[0] - b[0])).hypot(tint(a, 1) - tint(b, 1)).hypot(tint(a, 2) - tint(b, 2))
    }
}

fn measure(surface: &Surface, patches: &Patches) -> Vec<Part> {
    let mut parts = vec![Part::default(); patches.count];
    for (i, &patch) in patches.patch_of.iter().enumerate().filter(|(_, patch)| **patch != NONE) {
        let part = &mut parts[patch as usize];
        part.size += 1.0;
        (0..3).for_each(|c| part.lab[c] += surface.lab[i][c]);
    }
    parts.iter_mut().for_each(|part| part.lab = part.lab.map(|c| c / part.size.max(1.0)));
    parts
}

/// Looks a few pixels to both sides of each place where two patches meet: at the crease itself normals are no use.
fn find_borders(surface: &Surface, patches: &Patches) -> BTreeMap<(usize, usize), Border> {
    let (columns, rows) = (surface.columns, surface.rows);
    let mut borders: BTreeMap<(usize, usize), Border> = BTreeMap::new();
    let mut note = |i: usize, stride: usize, before: usize, after: usize| {
        let (a, b) = (patches.patch_of[i], patches.patch_of[i + stride]);
        if a != b && a != NONE && b != NONE {
            let border = borders.entry((a.min(b) as usize, a.max(b) as usize)).or_default();
            border.length += 1.0;
            if let Some(bend) = find_bend(surface, patches, i, stride, (before, after)) {
                border.continuous += 1.0;
                border.bend += bend;
            }
        }
    };
    for row in 0..rows {
        for column in 0..columns {
            let i = row * columns + column;
            if column + 1 < columns {
                note(i, 1, column, columns - 2 - column);
            }
            if row + 1 < rows {
                note(i, columns, row, rows - 2 - row);
            }
        }
    }
    borders
}

/// How the surface bends from a pixel to the next along a direction, the sine of the angle, positive for ridges; `None`
/// when it does not go on. There are `room` pixels before and after them.
fn find_bend(surface: &Surface, patches: &Patches, i: usize, stride: usize, room: (usize, usize)) -> Option<f32> {
    const REACH: usize = 4;
    let j = i + stride;
    // As far to each side as the patch goes.
    let same = |from: usize, to: usize| patches.patch_of[from] == patches.patch_of[to];
    let back = (0..=room.0.min(REACH)).rev().map(|k| i - k * stride).find(|k| same(*k, i))?;
    let on = (0..=room.1.min(REACH)).rev().map(|k| j + k * stride).find(|k| same(*k, j))?;
    let (n, m) = (surface.normals[back], surface.normals[on]);
    if n == Vector3::zeros() || m == Vector3::zeros() {
        return None;
    }
    let noise = noise_m(surface.depth_m[i].min(surface.depth_m[j]));
    let between = surface.points[j] - surface.points[i];
    let step = n.dot(&between).abs().min(m.dot(&between).abs());
    if step > 3.0 * noise || (surface.depth_m[i] - surface.depth_m[j]).abs() > 10.0 * noise + 0.02 {
        return None;
    }
    let angle = n.cross(&m).norm();
    let is_ridge = (surface.points[on] - surface.points[back]).dot(&(m - n)) > 0.0;
    Some(if is_ridge { angle } else { -angle })
}
