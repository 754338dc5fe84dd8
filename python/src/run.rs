//! Work that Ctrl-C can stop: it runs on a thread of its own, without Python's lock, while this one looks for signals.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

/// From look to look for signals.
const PERIOD: Duration = Duration::from_millis(50);
/// As much as a program's first thread has.
const STACK: usize = 8 << 20;

/// How far the work is, and whether it is to stop.
#[derive(Clone, Default)]
pub struct Progress {
    pub cancel: Arc<AtomicBool>,
    /// Iterations, records or refits done.
    pub done: Arc<AtomicU64>,
    /// The cost so far, by its bits.
    pub cost: Arc<AtomicU64>,
}

impl Progress {
    /// Nothing is done yet, and nothing is to stop.
    pub fn begin(&self) {
        self.cancel.store(false, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }
}

/// A result, and the exception of the signal that stopped the work, if one did.
pub struct Ended<T> {
    pub result: T,
    pub interrupted: Option<PyErr>,
}

/// Runs `work`. The callable `show` gets how far it is. The first exception (of a signal, or of `show`) sets the flag that stops the
/// work; a second one is raised when the work has ended.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    progress: &Progress,
    show: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<Ended<T>> {
    let (sender, mut receiver) = channel::<()>();
    thread::scope(|scope| {
        let named = thread::Builder::new().name("greybox".to_owned()).stack_size(STACK);
        let worker = named.spawn_scoped(scope, move || {
            // Dropped at the end, however that comes.
            let _ended = sender;
            in_this_process(work)
        });
        let worker = worker.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        let (mut interrupted, mut again) = (None, None);
        while wait(py, &mut receiver) == Err(RecvTimeoutError::Timeout) {
            let shown = show.map_or(Ok(()), |show| {
                let (done, cost) = (progress.done.load(Ordering::Relaxed), progress.cost.load(Ordering::Relaxed));
                show.call1((done, f64::from_bits(cost))).map(drop)
            });
            if let Err(error) = py.check_signals().and(shown) {
                progress.cancel.store(true, Ordering::Relaxed);
                if interrupted.is_none() { interrupted = Some(error) } else { again = Some(error) }
            }
        }
        let result = py.detach(|| worker.join()).unwrap_or_else(|panic| resume_unwind(panic));
        again.map_or(Ok(Ended { result, interrupted }), Err)
    })
}

/// Runs work that uses threads. A forked process has none of its parent's, for which rayon would wait for ever: it gets a pool of its own.
fn in_this_process<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static FIRST: OnceLock<u32> = OnceLock::new();
    static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let process = std::process::id();
    if *FIRST.get_or_init(|| process) == process {
        return work();
    }
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    let pool = match forked.take() {
        Some((of, pool)) if of == process => Some(pool),
        others => {
            // The threads of its parent's pool cannot be told to end.
            std::mem::forget(others);
            ThreadPoolBuilder::new().build().ok().map(Arc::new)
        }
    };
    *forked = pool.clone().map(|pool| (process, pool));
    drop(forked);
    // Without threads there is no other way than to work here.
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

fn wait(py: Python<'_>, receiver: &mut Receiver<()>) -> Result<(), RecvTimeoutError> {
    py.detach(move || receiver.recv_timeout(PERIOD))
}
