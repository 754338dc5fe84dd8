//! What is allocated: nothing inside loops over samples, and no memory that grows with them.

mod allocator;
#[path = "../common/mod.rs"]
mod common;
mod long_record;
mod many_records;
mod no_alloc;
#[path = "../common/spiral.rs"]
mod spiral;
