//! Files with many records, which a column tells apart.

use super::bytes::decoded;
use super::columns::{self, Cells};
use super::numbers::Numbers;
use super::read::Rows;
use super::{Column, DataFile};
use crate::error::Error;
use crate::layout::Layout;
use crate::record::Record;
use rustc_hash::FxHashMap;

/// So many names are looked at before all rows are read.
const FIRST: usize = 1000;

/// Records by the cell that their rows have in common, in the order of their first rows.
type Groups<T> = Vec<(String, Result<T, Error>)>;

impl DataFile {
    /// Reads a record for each text or whole number in the column `by`, named after it: of many devices in one file, that of each. Their
    /// rows may stand mixed. A record that cannot be read is an error in its place; rows without a name are one such record.
    ///
    /// ```
    /// # use greybox::{Model, Of, Scalar, signals};
    /// # signals! { pub struct Current { i: "A" } pub struct Supply { u: "V" } pub struct Winding { r: "ohm" } }
    /// # struct Motor;
    /// # impl Model for Motor {
    /// #     type State = Current; type Input = Supply; type Output = Current; type Parameters = Winding;
    /// #     fn output<S: Scalar>(&self, _: S, x: &Current<S>, _: &Supply<S>, _: &Winding<S>) -> Current<S> { *x }
    /// # }
    /// # let path = std::env::temp_dir().join(format!("greybox_groups_{}.csv", std::process::id()));
    /// # std::fs::write(&path, "motor,t,u,i\na,0,1,2\nb,0,3,4\na,1,1,2\nb,1,3,4\n").unwrap();
    /// use greybox::{DataFile, layout::Layout};
    ///
    /// let records = DataFile::new(&path).read_groups(&Layout::of::<Motor>(), "motor")?; // columns motor, t, u, i
    /// let (name, record) = &records[1];
    /// assert_eq!((records.len(), name.as_str()), (2, "b"));
    /// assert_eq!(record.as_ref().unwrap().inputs()[0].values[..], [3.0, 3.0]);
    /// # std::fs::remove_file(path).unwrap();
    /// # Ok::<(), greybox::Error>(())
    /// ```
    ///
    /// # Errors
    /// A file or a column that cannot be read at all, as [`read`](Self::read) has them.
    pub fn read_groups(&self, layout: &Layout, by: &str) -> Result<Groups<Record>, Error> {
        self.check(layout)?;
        let Some(mut file) = columns::open(self)? else { return self.text_groups(layout, by) };
        let mut plan = self.plan(layout, file.names(), |at| file.unit(at))?;
        let at = self.named(file.names(), by)?;
        let cells = columns::read(self, file.as_mut(), &mut plan, Some(at))?;
        let keys = match cells.last() {
            Some(Cells::Texts(keys)) => keys,
            other => {
                return Err(self.wrong_kind(by, other.map_or("nothing", Cells::kind), "text or whole numbers"));
            }
        };
        let mut places = Places::default();
        let mut groups: Groups<Vec<usize>> = vec![];
        for (row, key) in keys.iter().enumerate() {
            let place = places.of(self, key, by, &mut groups, Vec::new);
            if let Ok(rows) = &mut groups[place].1 {
                rows.push(row);
            }
        }
        let record = |rows: Vec<usize>| self.of_columns(&plan, file.as_ref(), &cells, Some(&rows));
        Ok(named(groups, record))
    }

    fn text_groups(&self, layout: &Layout, by: &str) -> Result<Groups<Record>, Error> {
        let (mut table, mut numbers, plan) = self.text(layout, &[by])?;
        let at = self.named(table.names(), by)?;
        let mut places = Places::default();
        let mut groups: Groups<Rows> = vec![];
        while table.next()? {
            let (key, before) = (decoded(table.cell(at)), groups.len());
            let place = places.of(self, &key, by, &mut groups, || Rows::new(&plan));
            if before < FIRST && groups.len() == FIRST {
                self.check_names(by, &groups, &numbers)?;
            }
            if let Ok(rows) = &mut groups[place].1
                && let Err(error) = rows.push(self, &plan, &table, &mut numbers, true)
            {
                groups[place].1 = Err(error);
            }
        }
        self.check_names(by, &groups, &numbers)?;
        Ok(named(groups, |rows| rows.finish(self, &plan, &table, &numbers)))
    }

    /// Refuses names that are numbers alone, and not whole: a column of measurements tells no records apart.
    fn check_names(&self, by: &str, groups: &Groups<Rows>, numbers: &Numbers) -> Result<(), Error> {
        let mut numbers = numbers.clone();
        let all: Option<Vec<f64>> = groups.iter().map(|(name, _)| numbers.read(name.as_bytes())).collect();
        match all.is_some_and(|all| all.iter().any(|number| number.is_finite() && number.fract() != 0.0)) {
            true => Err(self.wrong_kind(by, "numbers that are not whole", "text or whole numbers")),
            false => Ok(()),
        }
    }

    /// The place of a column that is no signal.
    fn named(&self, names: &[String], by: &str) -> Result<usize, Error> {
        // What was said of a signal of this name does not hold for it.
        DataFile { columns: vec![Column::new(by)], ..self.clone() }.place(names, by)
    }
}

/// The places of the groups by their names.
#[derive(Default)]
struct Places(FxHashMap<String, usize>);

impl Places {
    /// The place of a group, which is added where it is new.
    fn of<T>(
        &mut self,
        file: &DataFile,
        key: &str,
        by: &str,
        groups: &mut Groups<T>,
        new: impl FnOnce() -> T,
    ) -> usize {
        if let Some(place) = self.0.get(key) {
            return *place;
        }
        let rows = if key.is_empty() { Err(file.wrong_kind(by, "an empty cell", "names")) } else { Ok(new()) };
        self.0.insert(key.to_owned(), groups.len());
        groups.push((key.to_owned(), rows));
        groups.len() - 1
    }
}

/// The records of the groups.
fn named<T>(groups: Groups<T>, record: impl Fn(T) -> Result<Record, Error>) -> Groups<Record> {
    let of = |(key, rows): (String, Result<T, Error>)| {
        let record = rows.and_then(&record).map(|record| record.named(&key));
        (key, record)
    };
    groups.into_iter().map(of).collect()
}
