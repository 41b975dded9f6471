//! A thread a core, each with a runtime of its own, and every connection on one of them for good.
//!
//! Answering a request takes some ten microseconds. On one runtime for all threads, its one poller hands what is
//! ready from thread to thread, which costs more than it evens out, and where the system takes the processor from
//! the thread that polls, all connections wait. Here a thread polls for its own connections alone, as nginx's
//! processes do. Nothing may wait on these threads: reads that would are for the blocking pool, as are the short calls of the
//! file system unless it is of this machine's disks and [quick](crate::offload).

use std::{io, num::NonZero, sync::Arc, thread};

use tokio::{
    runtime::{Builder, Handle},
    sync::oneshot,
};

/// The threads. They end, and what runs on them, when this is dropped.
#[derive(Debug)]
pub(crate) struct Workers(Vec<Worker>);

#[derive(Debug)]
struct Worker {
    handle: Handle,
    /// Held by every connection: there are as many as clones.
    seat: Seat,
    _running: oneshot::Sender<()>,
}

/// A connection's place on a thread, until it is dropped.
pub(crate) type Seat = Arc<()>;

impl Workers {
    /// As many as there are processors for this process.
    ///
    /// # Errors
    /// Where the system gives no thread or no poller.
    pub(crate) fn start() -> io::Result<Self> {
        let count = thread::available_parallelism().map_or(1, NonZero::get);
        (0..count)
            .map(|index| Worker::start(format!("connections-{index}")))
            .collect::<io::Result<_>>()
            .map(Self)
    }

    /// The thread with the fewest connections.
    pub(crate) fn least_busy(&self) -> (&Handle, Seat) {
        let worker = self.0.iter().min_by_key(|worker| Arc::strong_count(&worker.seat));
        let worker = worker.expect("there is at least one processor");
        (&worker.handle, Arc::clone(&worker.seat))
    }
}

impl Worker {
    fn start(name: String) -> io::Result<Self> {
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let handle = runtime.handle().clone();
        let (running, stopped) = oneshot::channel::<()>();
        thread::Builder::new().name(name).spawn(move || {
            // A dropped sender is the sign.
            let _ = runtime.block_on(stopped);
            // A read from a dead disk must not keep the process.
            runtime.shutdown_background();
        })?;
        Ok(Self { handle, seat: Seat::default(), _running: running })
    }
}

#[cfg(test)]
mod tests {
    use std::{
        cell::Cell,
        sync::{
            Barrier,
            mpsc::{self, RecvTimeoutError},
        },
        time::Duration,
    };

    use super::*;

    thread_local! {
        /// Dropped when the thread ends.
        static AT_END: Cell<Option<mpsc::Sender<()>>> = const { Cell::new(None) };
    }

    #[test]
    fn a_thread_ends_though_a_call_on_its_pool_does_not() {
        let workers = Workers::start().expect("threads");
        let (handle, _seat) = workers.least_busy();
        let (tell, told) = mpsc::channel();
        let (begin, begun) = mpsc::channel();
        let end = Arc::new(Barrier::new(2));
        let stuck = Arc::clone(&end);
        handle.spawn(async move {
            AT_END.set(Some(tell));
            tokio::task::spawn_blocking(move || {
                begin.send(()).expect("somebody listens");
                stuck.wait();
            });
        });
        begun.recv().expect("it runs");
        drop(workers);
        // Far beyond what it takes: the test fails rather than hangs.
        let ended = told.recv_timeout(Duration::from_secs(20));
        assert_eq!(ended, Err(RecvTimeoutError::Disconnected), "the thread is still there");
        end.wait();
    }

    #[test]
    fn connections_go_to_the_thread_that_has_fewest_and_leave_it_when_they_end() {
        let workers = Workers::start().expect("threads");
        let count = workers.0.len();
        let mut seats: Vec<Seat> = (0..3 * count).map(|_| workers.least_busy().1).collect();
        let taken = || workers.0.iter().map(|w| Arc::strong_count(&w.seat) - 1).collect::<Vec<_>>();
        assert_eq!(taken(), vec![3; count]);
        let left = seats.swap_remove(0);
        let index = workers.0.iter().position(|w| Arc::ptr_eq(&w.seat, &left)).expect("a thread's");
        drop(left);
        assert_eq!(taken()[index], 2);
        seats.push(workers.least_busy().1);
        assert_eq!(taken(), vec![3; count]);
    }

    #[test]
    fn what_is_spawned_runs_there_and_ends_with_the_workers() {
        let workers = Workers::start().expect("threads");
        let (handle, seat) = workers.least_busy();
        let (tell, told) = mpsc::channel();
        handle.spawn(async move {
            let _seat = seat;
            tell.send(thread::current().name().map(str::to_owned)).expect("somebody listens");
            std::future::pending::<()>().await;
        });
        let name = told.recv().expect("it runs").expect("the thread has a name");
        assert!(name.starts_with("connections-"), "{name}");
        drop(workers);
        assert!(told.recv().is_err(), "the task is dropped, and its end of the channel");
    }
}
