//! Whether a file lies on a disk of this machine, and calls about files that may lie elsewhere.

use std::{fs::File, path::Path};

use tokio::{sync::Semaphore, task::spawn_blocking};

/// Most calls at a time about files that may lie elsewhere. A server of files that has gone away keeps every one of
/// them, and with it a thread of the pool, which others need.
const MAX_ELSEWHERE: usize = 64;

static ELSEWHERE: Semaphore = Semaphore::const_new(MAX_ELSEWHERE);

/// Runs a call that may never come back, on the blocking pool. Where too many of them are out, it waits for one to
/// come back.
pub(crate) async fn elsewhere<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let turn = ELSEWHERE.acquire().await;
    on_pool(move || {
        // Until the call comes back, whoever still waits for it.
        let _turn = turn;
        work()
    })
    .await
}

/// As if as many calls hung as there may be, until the return value is dropped.
#[cfg(test)]
pub(crate) async fn hang() -> impl Drop {
    ELSEWHERE.acquire_many(MAX_ELSEWHERE as u32).await.expect("it is never closed")
}

/// Runs a call on the blocking pool.
pub(crate) async fn on_pool<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    // The task is never cancelled: it can only fail by a panic of `work`.
    let outcome = spawn_blocking(work).await;
    outcome.unwrap_or_else(|e| std::panic::resume_unwind(e.into_panic()))
}

/// File systems of disks and memory, as `statfs(2)` numbers them: ext2 to ext4, XFS, Btrfs, F2FS, ZFS, bcachefs,
/// overlayfs (what lies below it is believed to be local, too), tmpfs, EROFS, SquashFS. Those of a network have
/// numbers too, but new ones come, and what a program answers for (FUSE) may be anywhere: what is not listed counts
/// as elsewhere.
#[cfg(target_os = "linux")]
const LOCAL: [u64; 10] = [
    0xEF53,
    0x5846_5342,
    0x9123_683E,
    0xF2F5_2010,
    0x2FC1_2FC1,
    0xCA45_1A4E,
    0x794C_7630,
    0x0102_1994,
    0xE0F5_E1E2,
    0x7371_7368,
];

/// Whether both file and folder do: a folder may hold links to other disks (blocking).
#[cfg(target_os = "linux")]
pub(crate) fn is_local(file: &File, folder: &Path) -> bool {
    use rustix::fs::{StatFs, fstatfs, statfs};
    // Of 32 or 64 bits, with or without a sign, by processor.
    let is_local = |system: StatFs| is_listed(system.f_type as u64 & 0xFFFF_FFFF);
    fstatfs(file).is_ok_and(is_local) && statfs(folder).is_ok_and(is_local)
}

#[cfg(target_os = "linux")]
fn is_listed(number: u64) -> bool {
    LOCAL.contains(&number)
}

/// Nothing tells here.
#[cfg(not(target_os = "linux"))]
pub(crate) fn is_local(_: &File, _: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[cfg(target_os = "linux")]
    #[test]
    fn disks_are_local_and_networks_programs_and_what_the_system_makes_up_are_not() {
        let [ext4, nfs, fuse, smb] = [0xEF53, 0x6969, 0x6573_5546, 0xFF53_4D42];
        assert!(is_listed(ext4) && ![nfs, fuse, smb].into_iter().any(is_listed));
        let made_up = File::open("/proc/self/status").expect("it is there");
        assert!(!is_local(&made_up, "/proc/self".as_ref()));
        let folder = tempfile::tempdir().expect("a temporary folder");
        assert!(!is_local(&made_up, folder.path()));
    }

    #[tokio::test]
    async fn calls_that_never_come_back_take_no_more_than_their_share_of_the_pool() {
        let (hang, hung) = mpsc::channel::<()>();
        let hung = std::sync::Arc::new(std::sync::Mutex::new(hung));
        for _ in 0..MAX_ELSEWHERE + 10 {
            let hung = std::sync::Arc::clone(&hung);
            tokio::spawn(elsewhere(move || hung.lock().is_ok_and(|hung| hung.recv().is_ok())));
        }
        let all_out = async {
            while ELSEWHERE.available_permits() > 0 {
                tokio::task::yield_now().await;
            }
        };
        // Far beyond what it takes: the test fails rather than hangs.
        let waiting = tokio::time::timeout(std::time::Duration::from_secs(20), all_out);
        waiting.await.expect("each holds its turn");
        assert_eq!(on_pool(|| 1).await, 1, "others have theirs");
        // They come back after all.
        drop(hang);
        assert_eq!(elsewhere(|| 2).await, 2);
    }
}
