//! [`Format`] and [`Version`] of an estimate's JSON.

crate::format::format!("greybox estimate", 2);
