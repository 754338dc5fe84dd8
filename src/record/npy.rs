//! Records from NumPy files, mapped into memory.

mod header;

use super::{Channel, Column, Record, Time};
use crate::error::Error;
use crate::layout::{Layout, Quantity};
pub(super) use header::Header;
use memmap2::Mmap;
use std::fs::File;
use std::path::Path;

/// Numbers of a mapped file.
struct Mapped {
    map: Mmap,
    /// Where they begin (bytes).
    begin: usize,
}

impl AsRef<[f64]> for Mapped {
    fn as_ref(&self) -> &[f64] {
        // Checked when it was made.
        bytemuck::try_cast_slice(&self.map[self.begin..]).unwrap_or_default()
    }
}

impl Record {
    /// A record in a folder of NumPy files, one per signal, named after it (`id.npy`): one-dimensional, `float64`. The files
    /// are mapped into memory, not read: a record may be larger than the memory. They must not change while it is in use.
    ///
    /// Time is even with a `step` (s) from zero, or else that of `t.npy` (s).
    ///
    /// # Errors
    /// A file that cannot be opened, or is something else; whatever [`new`](Record::new) refuses.
    pub fn from_npy(layout: &Layout, folder: impl AsRef<Path>, step: Option<f64>) -> Result<Self, Error> {
        let folder = folder.as_ref();
        let column = |name: &str| column(&folder.join(format!("{name}.npy")));
        let channels = |signals: &[Quantity]| -> Result<Vec<Channel>, Error> {
            let channel = |signal: &Quantity| Ok(Channel::new(&signal.name, &signal.unit, column(&signal.name)?));
            signals.iter().map(channel).collect()
        };
        let time = match step {
            Some(step) => Time::Uniform { start: 0.0, step },
            None => Time::Stamps(column("t")?.to_vec()),
        };
        let (inputs, outputs) = (channels(&layout.inputs)?, channels(&layout.outputs)?);
        let name = folder.file_name().map_or("record".into(), |name| name.to_string_lossy().into_owned());
        Ok(Record::new(layout.states.clone(), time, inputs, outputs)?.named(name))
    }
}

fn column(path: &Path) -> Result<Column, Error> {
    let failed = |source: Box<dyn std::error::Error + Send + Sync>| Error::File { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(|error| failed(error.into()))?;
    let header = Header::read(&mut file).map_err(|error| failed(error.into()))?;
    // SAFETY: nothing but numbers is read from the map, any bytes are numbers, and it is never written. That the file does
    // not change meanwhile is for its owner to see to, as the documentation says.
    let map = unsafe { Mmap::map(&file) }.map_err(|error| failed(error.into()))?;
    let numbers: Option<&[f64]> = map.get(header.begin..).and_then(|bytes| bytemuck::try_cast_slice(bytes).ok());
    let native = if cfg!(target_endian = "little") { "<f8" } else { ">f8" };
    match numbers {
        Some(numbers) if header.kind == native && header.shape == [numbers.len() as u64] => {
            Ok(Column::new(Mapped { map, begin: header.begin }))
        }
        _ => Err(failed(
            format!(
                "{} of shape {:?}{}: save one column of float64 in this machine's byte order, \
                 numpy.save(\"NAME.npy\", numpy.ascontiguousarray(x, float))",
                header.kind,
                header.shape,
                if header.by_columns && header.shape.len() > 1 { " by columns" } else { "" }
            )
            .into(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use crate::pmsm::{Drive, Surface, Winding};
    use crate::{Experiment, ExperimentOf, Fleet, Time, free, pmsm::Currents, simulate};

    /// A file of one column.
    fn save(path: &std::path::Path, values: impl Iterator<Item = f64>) {
        let numbers: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}", numbers.len() / 8);
        let header = format!("{header:<117}\n");
        std::fs::write(path, [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes(), &numbers].concat()).unwrap();
    }

    /// Parts of one mapped record, fitted side by side on threads after the record itself is gone: the bits of a record in memory.
    #[cfg(target_endian = "little")]
    #[test]
    fn mapped_records_outlive_the_one_they_are_cut_from() {
        let model = Surface::new(4).unwrap();
        let drive =
            |k: usize| Drive { ud: 0.0, uq: [20.0, 60.0][k / 30 % 2], w: 50.0 + 30.0 * (0.01 * k as f64).sin() };
        let (winding, step) = (Winding { rs: 0.6, ls: 4e-3, ke: 0.8 }, 1e-3);
        let (rest, time) = (Currents { id: 0.0, iq: 0.0 }, Time::Uniform { start: 0.0, step });
        let run = simulate(&model, &winding, &rest, time, &(0..2_000).map(drive).collect::<Vec<_>>()).unwrap();
        let whole = run.with_noise(Currents { id: 0.1, iq: 0.1 }, 1).experiment(&model).unwrap();
        let folder = std::env::temp_dir().join(format!("greybox-npy-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for channel in whole.record().inputs().iter().chain(whole.record().outputs()) {
            save(&folder.join(format!("{}.npy", channel.name)), channel.values.iter().copied());
        }
        let mapped = Experiment::from_npy(&model, &folder, Some(step)).unwrap();
        let cut = |record: ExperimentOf<Surface>| -> Vec<ExperimentOf<Surface>> {
            (0..40).map(|i| record.slice(50 * i..50 * (i + 1)).unwrap()).collect()
        };
        let start = Winding { rs: free(1.0), ls: free(3e-3), ke: free(0.5) };
        let fleet = Fleet::new(&model).parameters(start).fleet().unwrap();
        let bits = |records: Vec<ExperimentOf<Surface>>| -> Vec<[u64; 3]> {
            let answers = fleet.run(records).map(|answer| answer.unwrap().parameters);
            answers.map(|p| [p.rs, p.ls, p.ke].map(f64::to_bits)).collect()
        };
        let found = cut(mapped);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(bits(found), bits(cut(whole)));
    }
}
