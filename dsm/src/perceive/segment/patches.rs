//! Patches: what edges of depth, shape and colour enclose.

use super::surface::{Surface, noise_m};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Steps between the lowest and the highest weight of an edge.
const LEVELS: usize = 512;
/// Weight that stops every patch, in units of the weights below.
const HIGHEST: f32 = 4.0;
/// Preference for large patches: a patch of n pixels may have edges of `SCALE / n` more than its own.
const SCALE: f32 = 20.0;
/// Patches with fewer pixels go to the neighbour that is most like them.
const LEAST_PX: u32 = 40;
/// Step across the surface, in units of the noise, that weighs 1.
const STEP: f32 = 1.6;
/// Crease that weighs 1 when hollow, as 1 - cosine; ridges weigh less.
const CREASE: f32 = 0.12;
const RIDGE: f32 = 0.35;
/// Difference of colour (CIELAB, lightness counts less: shading) that weighs 1.
const COLOR: f32 = 9.0;
const LIGHTNESS: f32 = 0.5;

/// No patch: structure, or nothing measured.
pub(super) const NONE: u32 = u32::MAX;

/// Patches of an image.
pub(super) struct Patches {
    /// Number of its patch for each pixel, or [`NONE`].
    pub(super) patch_of: Vec<u32>,
    /// Number of patches.
    pub(super) count: usize,
}

/// Disjoint sets with what the criterion needs of each.
struct Forest {
    parent: Vec<u32>,
    size: Vec<u32>,
    /// Highest edge within, plus the preference for its size.
    limit: Vec<f32>,
}

impl Forest {
    fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), size: vec![1; count], limit: vec![SCALE; count] }
    }

    fn root(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            let up = self.parent[self.parent[at as usize] as usize];
            self.parent[at as usize] = up;
            at = up;
        }
        at
    }

    fn join(&mut self, a: u32, b: u32, weight: f32) {
        let (keep, go) = if self.size[a as usize] >= self.size[b as usize] { (a, b) } else { (b, a) };
        self.parent[go as usize] = keep;
        self.size[keep as usize] += self.size[go as usize];
        self.limit[keep as usize] = weight + SCALE / self.size[keep as usize] as f32;
    }
}

/// Graph-based segmentation of what is no structure.
pub(super) fn find_patches(surface: &Surface, structure: &[bool]) -> Patches {
    let (columns, rows) = (surface.columns, surface.rows);
    let is_node = |i: usize| surface.is_measured(i) && !structure[i];
    // To the right, and the three below.
    let offsets = [(1isize, 0usize), (-1, 1), (0, 1), (1, 1)];
    let edges: Vec<Vec<(u16, u32, u32)>> = (0..rows)
        .into_par_iter()
        .map(|row| {
            let mut edges = Vec::with_capacity(4 * columns);
            for column in 0..columns {
                let i = row * columns + column;
                if !is_node(i) {
                    continue;
                }
                for (dc, dr) in offsets {
                    let c = column as isize + dc;
                    if c < 0 || c >= columns as isize || row + dr >= rows {
                        continue;
                    }
                    let j = (row + dr) * columns + c as usize;
                    if is_node(j) {
                        let level = (find_weight(surface, i, j) / HIGHEST * (LEVELS - 1) as f32) as usize;
                        edges.push((level.min(LEVELS - 1) as u16, i as u32, j as u32));
                    }
                }
            }
            edges
        })
        .collect();
    let sorted = sort_by_level(&edges);
    let mut forest = Forest::new(columns * rows);
    let unit = HIGHEST / (LEVELS - 1) as f32;
    for &(level, i, j) in sorted.iter().filter(|edge| usize::from(edge.0) < LEVELS - 1) {
        let (a, b) = (forest.root(i), forest.root(j));
        let weight = f32::from(level) * unit;
        if a != b && weight <= forest.limit[a as usize].min(forest.limit[b as usize]) {
            forest.join(a, b, weight);
        }
    }
    // Crumbs go to the neighbour behind their lowest edge, unless it is the end of a surface.
    for &(level, i, j) in sorted.iter().filter(|edge| usize::from(edge.0) < LEVELS - 1) {
        let (a, b) = (forest.root(i), forest.root(j));
        if a != b && forest.size[a as usize].min(forest.size[b as usize]) < LEAST_PX {
            forest.join(a, b, f32::from(level) * unit);
        }
    }
    number(&mut forest, is_node)
}

/// Edges from the lowest weight up; of equal ones in their order.
fn sort_by_level(edges: &[Vec<(u16, u32, u32)>]) -> Vec<(u16, u32, u32)> {
    let mut starts = vec![0usize; LEVELS + 1];
    edges.iter().flatten().for_each(|edge| starts[usize::from(edge.0) + 1] += 1);
    (1..=LEVELS).for_each(|level| starts[level] += starts[level - 1]);
    let mut sorted = vec![(0, 0, 0); starts[LEVELS]];
    for edge in edges.iter().flatten() {
        let place = &mut starts[usize::from(edge.0)];
        sorted[*place] = *edge;
        *place += 1;
    }
    sorted
}

fn number(forest: &mut Forest, is_node: impl Fn(usize) -> bool) -> Patches {
    let total = forest.parent.len();
    let mut number_of = vec![NONE; total];
    let mut patch_of = vec![NONE; total];
    let mut count = 0;
    for (i, patch) in patch_of.iter_mut().enumerate().filter(|(i, _)| is_node(*i)) {
        let root = forest.root(i as u32) as usize;
        if forest.size[root] < LEAST_PX {
            continue;
        }
        if number_of[root] == NONE {
            number_of[root] = count;
            count += 1;
        }
        *patch = number_of[root];
    }
    Patches { patch_of, count: count as usize }
}

/// How much speaks for an edge between two neighbours; above [`HIGHEST`] nothing joins them.
fn find_weight(surface: &Surface, i: usize, j: usize) -> f32 {
    let (p, q) = (surface.points[i], surface.points[j]);
    let (n, m) = (surface.normals[i], surface.normals[j]);
    let depth = surface.depth_m[i].min(surface.depth_m[j]);
    let noise = noise_m(depth);
    let between: Vector3<f32> = q - p;
    let (known_n, known_m) = (n != Vector3::zeros(), m != Vector3::zeros());
    // Distance of each from the tangent plane of the other; along the ray where there is none.
    let step = match (known_n, known_m) {
        (true, true) => n.dot(&between).abs().min(m.dot(&between).abs()),
        (true, false) => n.dot(&between).abs(),
        (false, true) => m.dot(&between).abs(),
        (false, false) => 0.5 * (surface.depth_m[i] - surface.depth_m[j]).abs(),
    };
    let jump = (surface.depth_m[i] - surface.depth_m[j]).abs();
    if jump > 10.0 * noise + 0.03 {
        return 2.0 * HIGHEST;
    }
    let crease = if known_n && known_m {
        let bend = 1.0 - n.dot(&m);
        // Normals that spread apart are a ridge.
        bend / if between.dot(&(m - n)) > 0.0 { RIDGE } else { CREASE }
    } else {
        0.5
    };
    let (a, b) = (surface.lab[i], surface.lab[j]);
    let color = (LIGHTNESS * (a[0] - b[0])).hypot(a[1] - b[1]).hypot(a[2] - b[2]) / COLOR;
    step / (STEP * noise) + crease.min(2.0) + color
}
