//! Frontiers: floor that borders what was never seen.

use super::costmap::Costmap;
use super::grid::{Grid, bearing};
use super::planner::{Field, Pose2};
use dsm::map::CellState;
use nalgebra::{Point2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of exploration by frontiers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrontierConfig {
    /// Shortest frontier that counts, metres. Default 0.6, range 0.05 to 5.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub min_size_m: f64,
    /// Longer frontiers are split, metres. Default 2, range `min_size_m` to 10.
    #[schemars(range(max = 10.0))]
    pub max_size_m: f64,
    /// Smallest unknown area to be seen from the standing place, square metres. Default 0.8, range 0 to 20.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub min_gain_m2: f64,
    /// More unknown area than this does not make a frontier better, square metres: the view through a window is
    /// endless. Default 4, range `min_gain_m2` to 100.
    #[schemars(range(max = 100.0))]
    pub max_gain_m2: f64,
    /// How far the camera sees the floor well enough, metres. Default 3, range 0.5 to 10.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub sensor_range_m: f64,
    /// Nearest standing place to the frontier, metres. Default 0.3, range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub stand_min_m: f64,
    /// Farthest standing place from the frontier, metres. Default 1.2, range `stand_min_m` to 5.
    #[schemars(range(max = 5.0))]
    pub stand_max_m: f64,
    /// What a stop costs beside the way, metres of way. Default 3, range 0.1 to 50.
    #[schemars(range(min = 0.1, max = 50.0))]
    pub base_cost_m: f64,
    /// Frontiers nearer than this to one that was tried count as the same, metres. Default 0.4, range 0.05 to 5.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub repeat_radius_m: f64,
    /// After so many visits a frontier is given up. Default 3, range 1 to 20.
    #[schemars(range(min = 1, max = 20))]
    pub max_attempts: u32,
    /// Unknown patches smaller than this, closed in on all sides, are left alone, square metres. Default 0.3, range 0
    /// to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub min_hole_m2: f64,
}

impl Default for FrontierConfig {
    fn default() -> Self {
        Self {
            min_size_m: 0.6,
            max_size_m: 2.0,
            min_gain_m2: 0.8,
            max_gain_m2: 4.0,
            sensor_range_m: 3.0,
            stand_min_m: 0.3,
            stand_max_m: 1.2,
            base_cost_m: 3.0,
            repeat_radius_m: 0.4,
            max_attempts: 3,
            min_hole_m2: 0.3,
        }
    }
}

/// A stretch of floor that borders unknown space, and where to stand to look into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frontier {
    /// The frontier cell nearest to its middle, world frame, metres.
    pub center: Point2<f64>,
    /// Its length: number of cells times their side, metres.
    pub size_m: f64,
    /// Unknown floor to be seen from the standing place, square metres.
    pub gain_m2: f64,
    /// Where to stand, facing the unknown.
    pub stand: Pose2,
    /// Way to the standing place, metres.
    pub path_length_m: f64,
    /// Gain per metre of way (with the cost of a stop); higher is better.
    pub score: f64,
}

/// What exploration remembers: the frontiers that it tried and where it stood. It makes exploration end, because a place
/// is visited at most `max_attempts` times, whatever the map then says, each time from another stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrontierMemory {
    attempts: Vec<(Point2<f64>, u32)>,
    /// Frontier and stand of each visit.
    visits: Vec<(Point2<f64>, Point2<f64>)>,
}

impl FrontierMemory {
    /// Notes that the frontier was visited, or that no way led to it.
    pub fn record(&mut self, frontier: &Frontier, config: &FrontierConfig) {
        self.note(frontier.center, 1, config);
        self.visits.push((frontier.center, frontier.stand.position));
    }

    /// Gives a frontier up at once.
    pub fn give_up(&mut self, frontier: &Frontier, config: &FrontierConfig) {
        self.note(frontier.center, config.max_attempts, config);
    }

    /// Lets all frontiers that were given up be tried once more; whether there are any.
    pub fn reprieve(&mut self, config: &FrontierConfig) -> bool {
        let given_up = self.attempts.iter_mut().filter(|(_, attempts)| *attempts > config.max_attempts);
        given_up.map(|(_, attempts)| *attempts = config.max_attempts.saturating_sub(1)).count() > 0
    }

    fn note(&mut self, center: Point2<f64>, count: u32, config: &FrontierConfig) {
        match self.attempts.iter_mut().find(|(c, _)| (*c - center).norm() < config.repeat_radius_m) {
            Some((_, attempts)) => *attempts += count,
            None => self.attempts.push((center, count)),
        }
    }

    /// Whether a frontier around this point was looked at from near this stand.
    fn was_seen_from(&self, center: &Point2<f64>, stand: &Point2<f64>, config: &FrontierConfig) -> bool {
        let near = |a: &Point2<f64>, b: &Point2<f64>| (a - b).norm() < config.repeat_radius_m;
        self.visits.iter().any(|(seen, from)| near(seen, center) && near(from, stand))
    }

    /// How often frontiers around this point were tried.
    pub fn attempts(&self, center: &Point2<f64>, config: &FrontierConfig) -> u32 {
        let near = self.attempts.iter().filter(|(c, _)| (c - center).norm() < config.repeat_radius_m);
        near.map(|(_, attempts)| *attempts).sum()
    }
}

/// All frontiers worth a visit, best first; exploration of the floor is complete when there is none.
pub fn find_frontiers(
    costmap: &Costmap,
    field: &Field,
    memory: &FrontierMemory,
    config: &FrontierConfig,
) -> Vec<Frontier> {
    let grid = *costmap.grid();
    let worthwhile = find_worthwhile_unknown(costmap, config.min_hole_m2);
    let is_frontier =
        |cell: usize| costmap.state(cell) == CellState::Free && grid.straight_neighbours(cell).any(|n| worthwhile[n]);
    let frontier: Vec<bool> = (0..grid.len()).map(is_frontier).collect();
    let mut found = Vec::new();
    let mut seen_stamp = vec![0_u32; grid.len()];
    let mut stamp = 0;
    for cluster in split_clusters(&grid, find_clusters(&grid, &frontier), config.max_size_m) {
        let size_m = cluster.len() as f64 * grid.resolution_m;
        let center = find_center(&grid, &cluster);
        let tried = memory.attempts(&center, config);
        if size_m < config.min_size_m || tried >= config.max_attempts {
            continue;
        }
        let looks =
            find_stands(costmap, field, &center, memory, config).into_iter().map(|(position, path_length_m)| {
                stamp += 1;
                let (gain_m2, toward) = look_around(costmap, &worthwhile, &position, config, &mut seen_stamp, stamp);
                let effort = path_length_m + config.base_cost_m;
                let score = gain_m2.min(config.max_gain_m2) / effort / f64::from(1 + tried);
                let yaw_rad = if toward.norm() > 1e-9 { toward.y.atan2(toward.x) } else { bearing(&position, &center) };
                Frontier { center, size_m, gain_m2, stand: Pose2 { position, yaw_rad }, path_length_m, score }
            });
        let best = looks
            .filter(|look| look.gain_m2 >= config.min_gain_m2)
            .reduce(|a, b| if b.score > a.score { b } else { a });
        found.extend(best);
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found
}

/// Unknown cells of patches that are large or reach the border of the grid.
fn find_worthwhile_unknown(costmap: &Costmap, min_hole_m2: f64) -> Vec<bool> {
    let grid = *costmap.grid();
    let unknown: Vec<bool> = (0..grid.len()).map(|i| costmap.state(i) == CellState::Unknown).collect();
    let mut worthwhile = vec![false; grid.len()];
    for patch in find_clusters(&grid, &unknown) {
        let open = patch.iter().any(|&cell| {
            let (column, row) = grid.position(cell);
            column == 0 || row == 0 || column as usize + 1 == grid.columns || row as usize + 1 == grid.rows
        });
        if open || patch.len() as f64 * grid.resolution_m.powi(2) >= min_hole_m2 {
            patch.into_iter().for_each(|cell| worthwhile[cell] = true);
        }
    }
    worthwhile
}

/// Connected groups (eight neighbours) of marked cells, each in order of discovery.
pub(crate) fn find_clusters(grid: &Grid, marked: &[bool]) -> Vec<Vec<usize>> {
    let mut visited = vec![false; marked.len()];
    let mut clusters = Vec::new();
    for seed in 0..marked.len() {
        if !marked[seed] || visited[seed] {
            continue;
        }
        visited[seed] = true;
        let mut cluster = vec![seed];
        let mut next = 0;
        while next < cluster.len() {
            for (neighbour, _) in grid.neighbours(cluster[next]) {
                if marked[neighbour] && !visited[neighbour] {
                    visited[neighbour] = true;
                    cluster.push(neighbour);
                }
            }
            next += 1;
        }
        clusters.push(cluster);
    }
    clusters
}

/// Splits clusters at the middle of their longer side until each is at most `max_size_m` wide.
fn split_clusters(grid: &Grid, clusters: Vec<Vec<usize>>, max_size_m: f64) -> Vec<Vec<usize>> {
    let mut open = clusters;
    open.reverse();
    let mut done = Vec::new();
    while let Some(cluster) = open.pop() {
        let centers: Vec<_> = cluster.iter().map(|&cell| grid.center_of(cell)).collect();
        let low = centers.iter().fold(Point2::new(f64::MAX, f64::MAX), |a, b| a.inf(b));
        let high = centers.iter().fold(Point2::new(f64::MIN, f64::MIN), |a, b| a.sup(b));
        let size = high - low;
        let axis = usize::from(size.y > size.x);
        if size[axis] <= max_size_m {
            done.push(cluster);
            continue;
        }
        let middle = 0.5 * (low[axis] + high[axis]);
        let (left, right): (Vec<_>, Vec<_>) =
            cluster.into_iter().partition(|&cell| grid.center_of(cell)[axis] < middle);
        open.push(right);
        open.push(left);
    }
    done
}

/// The cell centre of the cluster nearest to its mean.
fn find_center(grid: &Grid, cluster: &[usize]) -> Point2<f64> {
    let sum: Vector2<f64> = cluster.iter().map(|&cell| grid.center_of(cell).coords).sum();
    let mean = Point2::from(sum / cluster.len().max(1) as f64);
    cluster
        .iter()
        .map(|&cell| grid.center_of(cell))
        .min_by(|a, b| (a - mean).norm_squared().total_cmp(&(b - mean).norm_squared()))
        .unwrap_or(mean)
}

/// Reachable places around a frontier that see its centre, those that cost least first: apart from each other, and from
/// those it was looked at from. One before a door may see nothing of what lies beside the door.
fn find_stands(
    costmap: &Costmap,
    field: &Field,
    center: &Point2<f64>,
    memory: &FrontierMemory,
    config: &FrontierConfig,
) -> Vec<(Point2<f64>, f64)> {
    /// Most places that are compared, and how far apart they are, metres.
    const MOST: usize = 6;
    const APART_M: f64 = 0.3;
    let grid = costmap.grid();
    let mut places: Vec<(f64, usize, f64)> = grid
        .cells_within(*center, config.stand_max_m)
        .filter(|&cell| costmap.is_traversable(cell))
        .filter_map(|cell| {
            let length = field.find_length_m(cell)?;
            let distance = (grid.center_of(cell) - center).norm();
            // Nearer to the frontier sees more of what lies behind it.
            let cost = length + 1.5 * distance + 0.1 * costmap.find_cost(cell)?;
            (distance >= config.stand_min_m).then_some((cost, cell, length))
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut stands: Vec<(Point2<f64>, f64)> = Vec::new();
    for (_, cell, length) in places {
        let position = grid.center_of(cell);
        let is_known = stands.iter().any(|(other, _)| (other - position).norm() < APART_M);
        if is_known || memory.was_seen_from(center, &position, config) {
            continue;
        }
        let distance = (center - position).norm();
        let mut crossed = grid.ray(position, bearing(&position, center), distance);
        if !crossed.any(|(crossed, _)| costmap.state(crossed) == CellState::Occupied) {
            stands.push((position, length));
        }
        if stands.len() == MOST {
            break;
        }
    }
    stands
}

/// Unknown area in sight of a place, and the mean direction in which it lies.
fn look_around(
    costmap: &Costmap,
    worthwhile: &[bool],
    position: &Point2<f64>,
    config: &FrontierConfig,
    seen_stamp: &mut [u32],
    stamp: u32,
) -> (f64, Vector2<f64>) {
    const RAYS: u32 = 240;
    let grid = costmap.grid();
    let mut cells = 0_u32;
    let mut toward = Vector2::zeros();
    for ray in 0..RAYS {
        let yaw = f64::from(ray) / f64::from(RAYS) * std::f64::consts::TAU;
        for (cell, _) in grid.ray(*position, yaw, config.sensor_range_m) {
            if costmap.state(cell) == CellState::Occupied {
                break;
            }
            if worthwhile[cell] && seen_stamp[cell] != stamp {
                seen_stamp[cell] = stamp;
                cells += 1;
                toward += (grid.center_of(cell) - position).normalize();
            }
        }
    }
    (f64::from(cells) * grid.resolution_m.powi(2), toward)
}

#[cfg(test)]
mod tests {
    //! Contract: exploration by frontiers sees the whole floor that can be reached and ends by itself, also when the map
    //! does not change any more; nothing is proposed for closed holes or unreachable places.
    use super::*;
    use crate::nav::CostmapConfig;
    use crate::nav::sight::tests::room_grid;
    use dsm::map::FreeSpace;

    /// Copies what a place sees of `truth` into `known`, from 0.5 to 3 m.
    fn look(truth: &FreeSpace, known: &mut FreeSpace, pose: &Pose2, half_view_rad: f64) {
        let grid = Grid::of(truth);
        let steps = 400;
        for step in 0..=steps {
            let yaw = pose.yaw_rad + (f64::from(step) / f64::from(steps) - 0.5) * 2.0 * half_view_rad;
            for (cell, distance) in grid.ray(pose.position, yaw, 3.0) {
                if distance > 0.5 {
                    known.set(truth.cell_at(&grid.center_of(cell)), truth.cells[cell]);
                }
                if truth.cells[cell] == CellState::Occupied {
                    break;
                }
            }
        }
    }

    #[test]
    fn exploration_sees_the_floor_and_ends() {
        let mut truth = room_grid();
        // Furniture: a table in the first room, a cupboard in the second one.
        for column in 20..44 {
            for row in 50..60 {
                truth.set([column, row], CellState::Occupied);
                truth.set([column + 90, row - 40], CellState::Occupied);
            }
        }
        let config = FrontierConfig::default();
        let mut memory = FrontierMemory::default();
        let mut known = FreeSpace::new(0.05);
        let mut pose = Pose2 { position: Point2::new(1.0, 1.0), yaw_rad: 0.3 };
        look(&truth, &mut known, &pose, 4.0);
        let mut visits = 0;
        let mut driven = 0.0;
        loop {
            let costmap = Costmap::from_free_space(&known, &CostmapConfig::default());
            let field = Field::from_start(&costmap, &pose.position);
            let Some(best) = find_frontiers(&costmap, &field, &memory, &config).into_iter().next() else { break };
            memory.record(&best, &config);
            pose = best.stand;
            driven += best.path_length_m;
            // The head pans to both sides.
            look(&truth, &mut known, &pose, 1.6);
            visits += 1;
            assert!(visits < 40, "exploration does not end");
        }
        let free: Vec<_> = truth.known_cells().filter(|(_, s)| *s == CellState::Free).collect();
        let seen = free.iter().filter(|(cell, _)| known.state(*cell) == CellState::Free).count();
        let share = seen as f64 / free.len() as f64;
        assert!(share > 0.93, "{share} of the floor after {visits} visits and {driven} m");
        assert!(visits <= 15 && driven < 40.0, "{visits} visits, {driven} m");
    }

    #[test]
    fn a_frontier_that_never_yields_is_given_up() {
        // Half a room is known; looking does not help (a window, a black floor).
        let mut known = FreeSpace::new(0.05);
        for column in 0..60 {
            for row in 0..60 {
                let wall = row == 0 || row == 59 || column == 0;
                known.set([column, row], if wall { CellState::Occupied } else { CellState::Free });
            }
        }
        let config = FrontierConfig::default();
        let costmap = Costmap::from_free_space(&known, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(1.0, 1.5));
        let mut memory = FrontierMemory::default();
        let mut stands: Vec<(Point2<f64>, Point2<f64>)> = Vec::new();
        while let Some(best) = find_frontiers(&costmap, &field, &memory, &config).into_iter().next() {
            assert!(best.stand.yaw_rad.abs() < 1.0, "faces the unknown at +x: {best:?}");
            // What one stand did not show, as from outside a door, another one may.
            let same = |(center, stand): &(Point2<f64>, Point2<f64>)| {
                (center - best.center).norm() < config.repeat_radius_m
                    && (stand - best.stand.position).norm() < config.repeat_radius_m
            };
            assert!(!stands.iter().any(same), "{best:?} once more from the same place");
            memory.record(&best, &config);
            stands.push((best.center, best.stand.position));
            assert!(stands.len() <= 8);
        }
        assert!(stands.len() >= 2);
    }

    #[test]
    fn a_passage_behind_a_door_is_looked_into_from_inside() {
        // A room of 4 m with a door in the corner of its far wall; behind it, a bed leaves a passage along that wall.
        let mut known = FreeSpace::new(0.05);
        for column in 0..80 {
            for row in 0..80 {
                let wall = column == 0 || column == 79 || row == 0 || (row >= 78 && !(4..22).contains(&column));
                known.set([column, row], if wall { CellState::Occupied } else { CellState::Free });
            }
        }
        for column in 0..23 {
            (80..97).for_each(|row| known.set([column, row], CellState::Free));
            known.set([column, 97], CellState::Occupied);
        }
        (80..98).for_each(|row| known.set([0, row], CellState::Occupied));
        (78..80).for_each(|row| [0, 1, 2, 3].iter().for_each(|column| known.set([*column, row], CellState::Occupied)));
        let costmap = Costmap::from_free_space(&known, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(2.0, 2.0));
        let found = find_frontiers(&costmap, &field, &FrontierMemory::default(), &FrontierConfig::default());
        let frontier = found.iter().find(|f| (f.center - Point2::new(1.12, 4.4)).norm() < 0.3).expect("the passage");
        assert!(frontier.stand.position.y > 4.0, "from outside only its end is seen: {frontier:?}");
    }

    #[test]
    fn closed_holes_do_not_attract() {
        let mut known = room_grid();
        for column in 30..38 {
            for row in 30..38 {
                known.set([column, row], CellState::Unknown);
            }
        }
        let costmap = Costmap::from_free_space(&known, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(1.0, 1.0));
        let config = FrontierConfig { min_gain_m2: 0.01, ..FrontierConfig::default() };
        assert_eq!(find_frontiers(&costmap, &field, &FrontierMemory::default(), &config), Vec::new());
    }
}
