//! [`in_order`]: work on items that are read ahead.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::time::Duration;

/// Items for each thread whose results are there before reading stops.
const ENOUGH: usize = 4;
/// Items for each thread that are begun before their turn has come: one is computed, one waits for a free thread.
const BEGUN: usize = 2;
/// Items for each thread that are read at most: while an early one takes long, the others go on.
const MOST: usize = 16;

/// `f` of some of the next items, in parallel; in their order. Nothing if there are no more items.
pub(super) fn in_order<T: Send, A: Send>(mut next: impl FnMut() -> Option<T>, f: impl Fn(T) -> A + Sync) -> Vec<A> {
    let (threads, f) = (rayon::current_num_threads(), &f);
    let (sender, receiver) = channel();
    let mut results: Vec<Option<A>> = vec![];
    // In the order of the items: the first are what others wait for.
    rayon::in_place_scope_fifo(|scope| {
        let (mut begun, mut ready) = (0, 0);
        loop {
            while begun < BEGUN * threads && ready < ENOUGH * threads && results.len() < MOST * threads {
                let Some(item) = next() else { break };
                let (number, sender) = (results.len(), sender.clone());
                results.push(None);
                begun += 1;
                // The receiver is there until all have been received.
                scope.spawn_fifo(move |_| drop(sender.send((number, catch_unwind(AssertUnwindSafe(|| f(item)))))));
            }
            if begun == 0 {
                break;
            }
            let Some((number, result)) = receive(&receiver) else { break };
            results[number] = Some(result.unwrap_or_else(|panic| resume_unwind(panic)));
            begun -= 1;
            ready += results[ready..].iter().take_while(|result| result.is_some()).count();
        }
    });
    results.into_iter().flatten().collect()
}

/// Waits for a message. A thread of rayon's pool works meanwhile, since it may be the only one.
fn receive<T>(receiver: &Receiver<T>) -> Option<T> {
    loop {
        match receiver.try_recv() {
            Ok(message) => return Some(message),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) => match rayon::yield_now() {
                Some(rayon::Yield::Executed) => {}
                Some(rayon::Yield::Idle) => match receiver.recv_timeout(PAUSE) {
                    Err(RecvTimeoutError::Timeout) => {}
                    received => return received.ok(),
                },
                None => return receiver.recv().ok(),
            },
        }
    }
}

/// How long a thread without work waits before it looks for work again.
const PAUSE: Duration = Duration::from_millis(1);

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
    use std::time::Instant;

    /// The first item ends after as many others as are read while it takes long: they do not wait for it.
    #[test]
    fn a_long_item_holds_up_no_other() {
        let threads = rayon::current_num_threads();
        if threads == 1 {
            return;
        }
        let mut items = 0..;
        let (ended, begin) = (AtomicUsize::new(0), Instant::now());
        let work = |item: usize| {
            while item == 0 && ended.load(SeqCst) < MOST * threads - 1 {
                assert!(begin.elapsed() < Duration::from_secs(20), "{} others have ended", ended.load(SeqCst));
                std::thread::yield_now();
            }
            ended.fetch_add(1, SeqCst);
            item
        };
        let results = in_order(|| items.next(), work);
        assert_eq!(results, (0..MOST * threads).collect::<Vec<_>>());
    }

    #[test]
    fn results_are_in_order_until_there_are_no_more_items() {
        for threads in 1..4 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut items = 0..50;
            let mut results = vec![];
            pool.install(|| {
                loop {
                    let some = in_order(|| items.next(), |n| n * n);
                    if some.is_empty() {
                        break;
                    }
                    assert!((1..=MOST * threads).contains(&some.len()));
                    results.extend(some);
                }
            });
            assert_eq!(results, (0..50).map(|n| n * n).collect::<Vec<_>>());
        }
    }

    /// One thread has an item and one more under way, however little is done, and no more results than are enough.
    #[test]
    fn no_more_items_are_read_than_are_begun() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (ended, mut read) = (AtomicUsize::new(0), 0);
        let next = || {
            read += 1;
            assert!(read - ended.load(SeqCst) <= BEGUN, "{read} read, {} ended", ended.load(SeqCst));
            Some(read)
        };
        let results = pool.install(|| in_order(next, |_| ended.fetch_add(1, SeqCst)));
        assert!((ENOUGH..ENOUGH + BEGUN).contains(&results.len()), "{}", results.len());
    }

    #[test]
    fn a_panic_is_passed_on() {
        let mut items = 0..9;
        let panicking = || in_order(|| items.next(), |n| assert!(n != 3, "the fourth"));
        let panic = catch_unwind(AssertUnwindSafe(panicking)).unwrap_err();
        assert!(panic.downcast_ref::<&str>().is_some_and(|text| *text == "the fourth"));
    }
}
