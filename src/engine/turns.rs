//! [`Turns`]: the instructions of even and of odd samples, without copies between them.
//!
//! Even samples read what is carried from its own slots and write it to a second set of slots; odd samples read the second set
//! and write the first. A copy takes the interpreter as long as an operation.

use super::code::{Code, Instruction, Operation, Slot};

/// Instructions of a sample: see [`Code`].
#[derive(Clone, Debug)]
pub(super) struct Turn {
    pub output: Vec<Instruction>,
    pub rows: Vec<Slot>,
    pub advance: Vec<Instruction>,
}

/// The turns of a code, and for each number that alternates its own slot and its second one.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    /// One or two.
    pub all: Vec<Turn>,
    pub moved: Vec<(Slot, Slot)>,
}

impl Turns {
    /// One turn where the code copies nothing, or where there are no slots left; else two, which need more slots.
    pub fn of(code: &mut Code) -> Self {
        let plain = Turn { output: code.output.clone(), rows: code.rows.clone(), advance: code.advance.clone() };
        let slots = code.slots;
        let (Ok(begin), true) = (Slot::try_from(slots), slots + code.carried < usize::from(Slot::MAX)) else {
            return Turns { all: vec![plain], moved: vec![] };
        };
        let Some(advance) = elsewhere(&plain.advance, code.carried, begin) else {
            return Turns { all: vec![plain], moved: vec![] };
        };
        code.slots += code.carried;
        let mut moved: Vec<(Slot, Slot)> =
            advance.iter().filter(|one| one.to >= begin).map(|one| (one.to - begin, one.to)).collect();
        moved.sort_unstable();
        moved.dedup();
        let mut there: Vec<Slot> = (0..=Slot::MAX).take(code.slots).collect();
        moved.iter().for_each(|(own, other)| there.swap(usize::from(*own), usize::from(*other)));
        let swapped = |slot: Slot| there.get(usize::from(slot)).copied().unwrap_or(slot);
        let renamed = |all: &[Instruction]| all.iter().map(|one| one.renamed(swapped, swapped)).collect();
        let second = Turn {
            output: renamed(&plain.output),
            rows: plain.rows.iter().map(|slot| swapped(*slot)).collect(),
            advance: renamed(&advance),
        };
        Turns { all: vec![Turn { advance, ..plain }, second], moved }
    }
}

/// The same, with each new value of what is carried written `begin` slots beyond its own slot; `None` if that saves no copy.
fn elsewhere(advance: &[Instruction], carried: usize, begin: Slot) -> Option<Vec<Instruction>> {
    let is_carried = |slot: Slot| usize::from(slot) < carried;
    let mut advance: Vec<Option<Instruction>> = advance.iter().copied().map(Some).collect();
    for at in (0..advance.len()).rev() {
        let Some(Instruction { operation: Operation::Copy, to, pairs: [[from, _], ..], .. }) = advance[at] else {
            continue;
        };
        if !is_carried(to) || is_carried(from) || from >= begin {
            continue;
        }
        // The instruction that computes the value writes it to its second slot; all that read it later read it there.
        let Some(made) = (0..at).rev().find(|i| advance[*i].is_some_and(|before| before.to == from)) else { continue };
        advance[at] = None;
        for (i, instruction) in advance.iter_mut().enumerate().skip(made) {
            let read = |slot: Slot| if i > made && slot == from { begin + to } else { slot };
            let write = |slot: Slot| if i == made { begin + to } else { slot };
            *instruction = instruction.map(|instruction| instruction.renamed(read, write));
        }
    }
    if advance.iter().all(Option::is_some) {
        return None;
    }
    let mut written = vec![false; carried];
    let mut other = |instruction: Instruction| {
        let read = |slot: Slot| if written.get(usize::from(slot)) == Some(&true) { begin + slot } else { slot };
        let write = |slot: Slot| if is_carried(slot) { begin + slot } else { slot };
        let renamed = instruction.renamed(read, write);
        if is_carried(instruction.to) {
            written[usize::from(instruction.to)] = true;
        }
        renamed
    };
    Some(advance.into_iter().flatten().map(&mut other).collect())
}
