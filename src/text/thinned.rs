//! [`Model::thinned`]: fewer samples of a record, where that leaves the plant what it is.

use super::Model;
use crate::error::Error;
use crate::layout::Kind;
use crate::record::Record;

impl Model {
    /// Every `n`-th sample of a record of this model, as [`Record::decimate`] has them.
    ///
    /// # Errors
    /// [`Error::Thinned`] of a discrete model, or one whose samples change states (`jump`); as [`Record::decimate`].
    pub fn thinned(&self, record: &Record, n: usize) -> Result<Record, Error> {
        let layout = self.equations.layout();
        let jumping = self.document.states.iter().find(|state| state.jump.is_some());
        let why = match jumping {
            _ if n <= 1 => None,
            Some(state) => Some(format!("samples change state `{}` (jump)", state.quantity.name)),
            None => {
                (layout.kind == Kind::Discrete).then(|| "the model is discrete, and its step is one sample".to_owned())
            }
        };
        match why {
            Some(why) => Err(Error::Thinned { experiment: record.name().to_owned(), every: n, why }),
            None => record.decimate(n),
        }
    }
}
