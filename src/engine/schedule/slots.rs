//! Slots, and moves between them.

use super::{Slot, TooLarge};
use rustc_hash::FxHashMap;

/// The slots in use.
pub(super) struct Slots {
    count: usize,
    /// Slots from here on are given back.
    temporary_from: Option<usize>,
    free: Vec<Slot>,
    /// Whether each slot is among the free ones; as long as the highest of them.
    is_free: Vec<bool>,
}

/// A slot by its number.
pub(super) fn narrow(slot: usize) -> Result<Slot, TooLarge> {
    let limit = usize::from(Slot::MAX);
    Slot::try_from(slot).map_err(|_| TooLarge { limit })
}

impl Slots {
    /// Slots after those that are given.
    pub fn after(count: usize) -> Self {
        Slots { count, temporary_from: None, free: vec![], is_free: vec![] }
    }

    /// A slot for good.
    pub fn fresh(&mut self) -> Result<Slot, TooLarge> {
        let slot = narrow(self.count)?;
        self.count += 1;
        Ok(slot)
    }

    /// A slot that is given back.
    pub fn temporary(&mut self) -> Result<Slot, TooLarge> {
        self.temporary_from.get_or_insert(self.count);
        match self.free.pop() {
            Some(slot) => {
                self.is_free[usize::from(slot)] = false;
                Ok(slot)
            }
            None => self.fresh(),
        }
    }

    /// Gives a temporary slot back; others stay.
    pub fn release(&mut self, slot: Slot) {
        let at = usize::from(slot);
        if self.temporary_from.is_none_or(|from| at < from) {
            return;
        }
        if self.is_free.len() <= at {
            self.is_free.resize(at + 1, false);
        }
        if !self.is_free[at] {
            self.is_free[at] = true;
            self.free.push(slot);
        }
    }

    /// All slots.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Moves `(to, from)`, one for each target, that are to happen at once, one after the other; `spare` breaks rings.
pub(super) fn sequence(moves: Vec<(Slot, Slot)>, spare: Slot) -> Vec<(Slot, Slot)> {
    let mut waiting: FxHashMap<Slot, Slot> = moves.iter().copied().collect();
    let mut readers: FxHashMap<Slot, Vec<Slot>> = FxHashMap::default();
    moves.iter().for_each(|(to, from)| readers.entry(*from).or_default().push(*to));
    // How many still read each slot; a target that nobody reads any more can be written.
    let mut left: FxHashMap<Slot, usize> = readers.iter().map(|(slot, all)| (*slot, all.len())).collect();
    let mut ready: Vec<Slot> = moves.iter().map(|(to, _)| *to).filter(|to| !left.contains_key(to)).collect();
    let mut ordered = Vec::with_capacity(moves.len());
    for &(first, _) in &moves {
        loop {
            while let Some(to) = ready.pop() {
                let Some(from) = waiting.remove(&to) else { continue };
                ordered.push((to, from));
                let Some(count) = left.get_mut(&from) else { continue };
                *count -= 1;
                if *count == 0 && waiting.contains_key(&from) {
                    ready.push(from);
                }
            }
            if !waiting.contains_key(&first) {
                break;
            }
            // Only rings are left: the first target's old value is kept aside for its reader.
            ordered.push((spare, first));
            let reader = readers.get(&first).and_then(|all| all.iter().find(|to| waiting.contains_key(to)));
            reader.and_then(|reader| waiting.insert(*reader, spare));
            ready.push(first);
        }
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moves_that_read_each_other_keep_their_values() {
        // A ring of three, a swap, a chain, and one value to two places.
        let moves = vec![(0, 1), (1, 2), (2, 0), (3, 4), (4, 3), (5, 6), (6, 7), (8, 7)];
        let mut values: Vec<usize> = (0..10).collect();
        for (to, from) in sequence(moves.clone(), 9) {
            values[usize::from(to)] = values[usize::from(from)];
        }
        for (to, from) in moves {
            assert_eq!(values[usize::from(to)], usize::from(from));
        }
    }
}
