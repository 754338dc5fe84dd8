//! [`Control`]: what may stop an evaluation.

use crate::optimize::Outcome;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Conditions that stop an evaluation.
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

    /// The same with a part of the time that is left.
    pub fn for_part(&self, part: f64) -> Control {
        let now = Instant::now();
        let until = |deadline: Instant| now + deadline.saturating_duration_since(now).mul_f64(part);
        Control { cancel: self.cancel.clone(), deadline: self.deadline.map(until) }
    }

    /// What stopped it.
    pub fn reason(&self) -> &'static str {
        if self.expired() { "the time limit was over" } else { "the fit was cancelled" }
    }

    /// The outcome of a search, with the time limit named where that is what stopped it.
    pub fn named(&self, outcome: Outcome) -> Outcome {
        if outcome == Outcome::Cancelled && self.expired() { Outcome::TimeLimit } else { outcome }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_time_limit_is_named() {
        let until = |deadline: Instant| Control { cancel: None, deadline: Some(deadline) };
        let (past, later) = (until(Instant::now()), until(Instant::now() + Duration::from_secs(1000)));
        let flag = Control { cancel: Some(Arc::new(AtomicBool::new(true))), deadline: None };
        assert_eq!([&past, &later, &flag, &Control::NEVER].map(Control::stops), [true, false, true, false]);
        let named = [&past, &later, &flag].map(|control| control.named(Outcome::Cancelled));
        assert_eq!(named, [Outcome::TimeLimit, Outcome::Cancelled, Outcome::Cancelled]);
        assert_eq!(past.named(Outcome::Exact), Outcome::Exact);
        let left = later.for_part(0.25).deadline.unwrap() - Instant::now();
        assert!(left <= Duration::from_secs(250) && left > Duration::from_secs(240), "{left:?}");
        assert!(past.for_part(0.25).stops() && !Control::NEVER.for_part(0.25).stops());
    }
}
