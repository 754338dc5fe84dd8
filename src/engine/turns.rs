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
    // For each instruction, the last copy of its value to a number that alternates. The instruction then writes to the second slot of that number,
    // from which later instructions read the value, and the copy is left out.
    let (mut carries, mut writer) = (vec![None; advance.len()], vec![None; begin.into()]);
    for (at, one) in advance.iter().enumerate() {
        let Instruction { operation, to, pairs: [[from, _], ..], .. } = *one;
        let copies = operation == Operation::Copy && is_carried(to) && !is_carried(from);
        if let Some(made) = writer[usize::from(from)].filter(|_| copies) {
            carries[made] = Some(at);
        }
        writer[usize::from(to)] = Some(at);
    }
    let mut saved = vec![false; advance.len()];
    carries.iter().flatten().for_each(|copy: &usize| saved[*copy] = true);
    if !saved.contains(&true) {
        return None;
    }
    let mut there: Vec<Slot> = (0..begin).collect();
    let mut moved = |(at, one): (usize, &Instruction)| {
        let to = carries[at].map_or(one.to, |copy: usize| begin + advance[copy].to);
        let renamed = one.renamed(|slot| there[usize::from(slot)], |_| to);
        there[usize::from(one.to)] = to;
        (!saved[at]).then_some(renamed)
    };
    let advance: Vec<Instruction> = advance.iter().enumerate().filter_map(&mut moved).collect();
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
    Some(advance.into_iter().map(&mut other).collect())
}
