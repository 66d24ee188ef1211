//! The map: objects, relations, rooms and free space, and the one way to change it.

mod attributes;
mod copies;
mod free_space;
mod object;
mod provenance;
mod relation;
mod room;
mod update;
mod votes;

pub use attributes::{AttributeKind, Attributes};
pub use copies::copy_beside;
pub use free_space::{CellState, FreeSpace};
pub use object::{MapObject, MapPoint, ObjectId, ObjectState};
pub use provenance::{Credit, MOST_CREDITS, Provenance, VoteSubject};
pub use relation::{Relation, RelationKind};
pub use room::{Room, RoomId};
pub use update::{Changed, Map, MapChange, MapUpdate, RemovalReason};
pub use votes::Votes;
