//! Slots, and moves between them.

use super::{Slot, TooLarge};

/// The slots in use.
pub(super) struct Slots {
    count: usize,
    /// Slots from here on are given back.
    temporary_from: Option<usize>,
    free: Vec<Slot>,
}

/// A slot by its number.
pub(super) fn narrow(slot: usize) -> Result<Slot, TooLarge> {
    let limit = usize::from(Slot::MAX);
    Slot::try_from(slot).map_err(|_| TooLarge { limit })
}

impl Slots {
    /// Slots after those that are given.
    pub fn after(count: usize) -> Self {
        Slots { count, temporary_from: None, free: vec![] }
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
            Some(slot) => Ok(slot),
            None => self.fresh(),
        }
    }

    /// Gives a temporary slot back; others stay.
    pub fn release(&mut self, slot: Slot) {
        if self.temporary_from.is_some_and(|from| usize::from(slot) >= from) && !self.free.contains(&slot) {
            self.free.push(slot);
        }
    }

    /// All slots.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Moves `(to, from)` that are to happen at once, one after the other; `spare` breaks rings.
pub(super) fn sequence(mut moves: Vec<(Slot, Slot)>, spare: Slot) -> Vec<(Slot, Slot)> {
    let mut ordered = vec![];
    while !moves.is_empty() {
        // One whose target nobody reads any more.
        let ready = moves.iter().position(|(to, _)| !moves.iter().any(|(_, from)| from == to));
        match ready {
            Some(at) => ordered.push(moves.swap_remove(at)),
            None => {
                // Only rings are left: the first target's old value is kept aside for its reader.
                let kept = moves[0].0;
                ordered.push((spare, kept));
                for (_, from) in moves.iter_mut().filter(|(_, from)| *from == kept) {
                    *from = spare;
                }
            }
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
