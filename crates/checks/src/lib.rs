//! Nothing but a place: the benches and tests of the whole tree, `benches/` and part of `tests/`, belong to this package, so
//! that the library's own package stays free of what only they need.
