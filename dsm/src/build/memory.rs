//! How much memory a map and its builder hold.

use super::MapBuilder;
use super::cell_grid::CellGrid;
use super::occupancy::Occupancy;
use super::rooms::RoomSegmenter;
use super::track::Track;
use super::tracks::Tracks;
use super::view::View;
use super::window::Window;
use crate::map::{Map, MapObject, Relation};
use std::mem::size_of;

/// What the names, attributes and tree nodes of one object take, bytes: measured generously.
const WORDS: usize = 4096;

impl MapBuilder {
    /// Bytes that the builder holds beside the map: windows with their views, evidence of free space, rooms. Grows with
    /// the objects and the floor, not with time.
    pub fn held_bytes(&self) -> usize {
        self.tracks.held_bytes() + self.drift.bytes() + self.occupancy.held_bytes() + self.rooms.held_bytes()
    }
}

impl Map {
    /// Bytes that the map holds: objects with their points, relations, free space.
    pub fn held_bytes(&self) -> usize {
        let object = |object: &MapObject| {
            let features = object.visual_feature.capacity() + object.text_feature.capacity();
            size_of::<MapObject>() + object.points.capacity() * size_of::<crate::map::MapPoint>() + 4 * features + WORDS
        };
        self.objects.values().map(|o| object(o)).sum::<usize>()
            + self.relations.capacity() * size_of::<Relation>()
            + self.free_space.cells.capacity()
    }
}

impl Tracks {
    fn held_bytes(&self) -> usize {
        let tracks = self.ids().filter_map(|id| self.find(id));
        tracks.map(|track| size_of::<Track>() + track.window.held_bytes() + 8 * track.seen.capacity()).sum()
    }
}

impl Window {
    fn held_bytes(&self) -> usize {
        self.voxel_bytes() + self.views().iter().map(|view| size_of::<View>() + view.cell_bytes()).sum::<usize>()
    }
}

impl Occupancy {
    fn held_bytes(&self) -> usize {
        self.grids_bytes()
    }
}

impl RoomSegmenter {
    fn held_bytes(&self) -> usize {
        self.labels().held_bytes()
    }
}

impl<T> CellGrid<T> {
    /// Bytes of its cells.
    pub(super) fn held_bytes(&self) -> usize {
        self.capacity() * size_of::<T>()
    }
}
