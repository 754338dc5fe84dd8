//! [`Control`]: what may stop an evaluation.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What may stop an evaluation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Control {
    pub cancel: Option<Arc<AtomicBool>>,
    pub deadline: Option<Instant>,
}

impl Control {
    /// Nothing does.
    pub const NEVER: Control = Control { cancel: None, deadline: None };

    pub fn stops(&self) -> bool {
        self.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed)) || self.expired()
    }

    pub fn expired(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}
