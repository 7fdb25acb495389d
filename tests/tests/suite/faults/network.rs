use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use tests::programs::WorkerProcess;

use super::{assert_undisturbed, bake_by, wait_until_under_way, worker};

/// A way to a worker that can be cut: both ends keep their sockets, and nothing gets through.
struct Way {
    address: String,
    cut: Arc<AtomicBool>,
}

impl Way {
    fn to(worker: &WorkerProcess) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let cut = Arc::new(AtomicBool::new(false));
        let (target, is_cut) = (worker.address.clone(), Arc::clone(&cut));
        thread::spawn(move || {
            for near in listener.incoming().map_while(Result::ok) {
                let Ok(far) = TcpStream::connect(&target) else { continue };
                for (from, to) in [(near.try_clone().unwrap(), far.try_clone().unwrap()), (far, near)] {
                    let is_cut = Arc::clone(&is_cut);
                    thread::spawn(move || forward(from, to, &is_cut));
                }
            }
        });
        Self { address, cut }
    }

    fn set_cut(&self, cut: bool) {
        self.cut.store(cut, Ordering::Relaxed);
    }
}

fn forward(mut from: TcpStream, mut to: TcpStream, is_cut: &AtomicBool) {
    let mut buffer = [0; 1 << 16];
    while let Ok(length @ 1..) = from.read(&mut buffer) {
        while is_cut.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_millis(10));
        }
        if to.write_all(&buffer[..length]).is_err() {
            break;
        }
    }
    // The other end is told; it may know already.
    let _ = to.shutdown(std::net::Shutdown::Both);
}

#[test]
fn cut_and_healed() {
    let worker_process = WorkerProcess::start(1);
    let way = Way::to(&worker_process);
    let mut solving = bake_by(&[&way.address], &["--worker-grace", "600"]);
    wait_until_under_way(&mut solving);
    way.set_cut(true);
    solving.wait_for("it is silent");
    way.set_cut(false);
    let solved = solving.finish();
    assert_undisturbed(&solved);
    let connections = worker(&solved, &way.address)["connections"].as_u64().unwrap();
    assert!(connections >= 2, "{}", solved.report);
}

#[test]
fn cut_beside_another() {
    let workers = [WorkerProcess::start(1), WorkerProcess::start(1)];
    let way = Way::to(&workers[0]);
    let mut solving = bake_by(&[&way.address, &workers[1].address], &[]);
    wait_until_under_way(&mut solving);
    way.set_cut(true);
    let solved = solving.finish();
    assert_undisturbed(&solved);
}

/// Two ways to one worker are one worker.
#[test]
fn two_ways_to_one_worker() {
    let worker_process = WorkerProcess::start(1);
    let way = Way::to(&worker_process);
    let solved = bake_by(&[&way.address, &worker_process.address], &[]).finish();
    assert_undisturbed(&solved);
    assert_eq!(solved.report["workers"].as_array().unwrap().len(), 1, "{}", solved.report);
}
