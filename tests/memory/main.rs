//! What is allocated: nothing inside loops over samples, and no memory that grows with them.

mod allocator;
mod long_record;
mod many_records;
mod no_alloc;
