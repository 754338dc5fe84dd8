//! [`Format`] and [`Version`] of a report's JSON.

crate::format::format!("greybox report", 4);
