//! Map files: append-only checksummed log, exports.
