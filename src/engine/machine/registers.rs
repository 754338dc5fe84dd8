//! Which slots stand in registers.

use super::super::code::Slot;

/// Never read again.
pub(super) const NEVER: usize = usize::MAX;

/// The work needed before a register is free.
pub(super) enum Freed {
    /// Nothing.
    Clean(u8),
    /// Its number goes to its slot.
    Spilled(u8, Slot),
}

/// The contents of the registers, and when each slot is read next.
pub(super) struct Registers {
    slot_in: Vec<Option<Slot>>,
    register_of: Vec<Option<u8>>,
    /// Slots whose register is newer than their memory.
    dirty: Vec<bool>,
    /// Registers that the instruction at hand uses.
    held: Vec<bool>,
    pub next: Vec<usize>,
}

impl Registers {
    pub fn new(registers: u8, slots: usize) -> Self {
        Registers {
            slot_in: vec![None; registers.into()],
            register_of: vec![None; slots],
            dirty: vec![false; slots],
            held: vec![false; registers.into()],
            next: vec![NEVER; slots],
        }
    }

    /// Where a slot's number stands, if in a register, which is then held.
    pub fn find(&mut self, slot: Slot) -> Option<u8> {
        let found = self.register_of[usize::from(slot)];
        found.into_iter().for_each(|register| self.held[usize::from(register)] = true);
        found
    }

    /// Whether a number in memory that is read again at `next` is worth a register: a free one, or that of another that is in
    /// memory, too, and is read later.
    pub fn is_worth_loading(&self, next: usize) -> bool {
        let later = |slot: Slot| !self.dirty[usize::from(slot)] && self.next[usize::from(slot)] > next;
        let mut open = self.slot_in.iter().zip(&self.held).filter(|(_, held)| !**held);
        next != NEVER && open.any(|(slot, _)| slot.is_none_or(later))
    }

    /// A register for something new, held: a free one; else that of a number which is in memory, too, the one that is read last; else
    /// that of the number which is read last, which is to be stored. A store costs as much as an operation, an operand in memory
    /// next to nothing.
    pub fn take(&mut self) -> Option<Freed> {
        let last_read = |(_, slot): &(usize, &Option<Slot>)| match slot {
            None => (true, NEVER, true),
            Some(slot) => {
                let (next, dirty) = (self.next[usize::from(*slot)], self.dirty[usize::from(*slot)]);
                (!dirty || next == NEVER, next, false)
            }
        };
        let open = self.slot_in.iter().enumerate().filter(|(register, _)| !self.held[*register]);
        let (register, slot) = open.max_by_key(last_read)?;
        let (number, slot) = (u8::try_from(register).ok()?, *slot);
        self.held[register] = true;
        let Some(slot) = slot else { return Some(Freed::Clean(number)) };
        let spilled = self.dirty[usize::from(slot)] && self.next[usize::from(slot)] != NEVER;
        self.forget(slot);
        Some(if spilled { Freed::Spilled(number, slot) } else { Freed::Clean(number) })
    }

    /// A slot's number now stands in this register; `dirty`: and nowhere else.
    pub fn bind(&mut self, slot: Slot, register: u8, dirty: bool) {
        self.forget(slot);
        if let Some(before) = self.slot_in[usize::from(register)] {
            self.forget(before);
        }
        self.slot_in[usize::from(register)] = Some(slot);
        self.register_of[usize::from(slot)] = Some(register);
        self.dirty[usize::from(slot)] = dirty;
    }

    /// A slot's number is in no register any more.
    pub fn forget(&mut self, slot: Slot) {
        if let Some(register) = self.register_of[usize::from(slot)].take() {
            self.slot_in[usize::from(register)] = None;
            self.dirty[usize::from(slot)] = false;
        }
    }

    /// A register that was taken for the instruction at hand alone.
    pub fn free(&mut self, register: u8) {
        self.held[usize::from(register)] = false;
    }

    /// The end of an instruction: its registers may be taken again.
    pub fn release(&mut self) {
        self.held.fill(false);
    }

    /// The register of a slot's number.
    pub fn of(&self, slot: Slot) -> Option<u8> {
        self.register_of[usize::from(slot)]
    }

    /// Of the slots below this number those that stand in registers, with their registers; no more than half of the registers.
    pub fn first(&self, slots: usize) -> Vec<(Slot, u8)> {
        let there = (0..).zip(&self.register_of[..slots]).filter_map(|(slot, register)| register.map(|r| (slot, r)));
        there.take(self.slot_in.len() / 2).collect()
    }

    /// The numbers that must be written to their slots, for whoever reads these; all that is read again is then in both.
    pub fn unwritten(&mut self) -> Vec<(u8, Slot)> {
        let dirty: Vec<(u8, Slot)> = (0u8..)
            .zip(&self.slot_in)
            .filter_map(|(register, slot)| slot.map(|slot| (register, slot)))
            .filter(|(_, slot)| self.dirty[usize::from(*slot)] && self.next[usize::from(*slot)] != NEVER)
            .collect();
        dirty.iter().for_each(|(_, slot)| self.dirty[usize::from(*slot)] = false);
        dirty
    }

    /// Nothing is in a register any more.
    pub fn clear(&mut self) {
        // Not all slots, of which there may be thousands: this follows each call of a function.
        for slot in self.slot_in.iter_mut().filter_map(Option::take) {
            self.register_of[usize::from(slot)] = None;
            self.dirty[usize::from(slot)] = false;
        }
    }
}
