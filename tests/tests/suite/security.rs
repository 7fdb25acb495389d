//! Who may talk to a worker, with real processes: what is refused says why and what to do, and the worker lives on.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use protocol::security::TlsFiles;
use tempfile::TempDir;
use tests::builder::{Material, SceneBuilder};
use tests::certificates::{Authority, ExtendedKeyUsagePurpose, arguments, of_caller, of_server};
use tests::programs::{Solved, Solving, WorkerProcess, binary};
use tests::shapes;

/// Far above what any of these connections lasts: only what hangs ends here.
const HANGS: Duration = Duration::from_secs(60);

/// A scene that bakes in no time, and room for other files.
struct Bench {
    folder: TempDir,
    scene: PathBuf,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("room.glb");
        let room = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0));
        std::fs::write(&scene, room.glb()).unwrap();
        Self { folder, scene }
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    /// Bakes the scene on workers that nobody waits for.
    fn solve(&self, workers: &str, arguments: &[&str]) -> Solved {
        let workers = ["--workers", workers, "--worker-grace", "0.5"];
        Solving::start(&self.scene, &[&workers, arguments].concat()).finish()
    }

    fn assert_refused(&self, worker: &WorkerProcess, arguments: &[&str], words: &[&str]) {
        let refused = self.solve(&worker.address, arguments);
        assert!(!refused.success && refused.lit.is_none(), "not refused: {}", refused.said);
        for word in words.iter().chain([&worker.address.as_str(), &"error: "]) {
            assert!(refused.said.contains(word), "{word:?} is missing in: {}", refused.said);
        }
        assert!(!refused.said.contains("panicked"), "{}", refused.said);
    }
}

fn start(arguments: &[&str]) -> WorkerProcess {
    WorkerProcess::start_at("127.0.0.1:0", 1, arguments)
}

/// An end that is called by the address of these tests.
fn here(authority: &Authority) -> TlsFiles {
    authority.sign(&["127.0.0.1", "localhost"])
}

fn health(address: &str, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(binary("worker"));
    let output = command.args(["--health", address]).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn encrypted_workers_bake_the_same_bytes() {
    let (bench, authority) = (Bench::new(), Authority::new());
    let (worker, coordinator) = (here(&authority), authority.sign(&["coordinator"]));
    let token = bench.file("token", "a secret of many words\n".replace(' ', "-").as_str());
    let secured = |files| [&arguments(files)[..], &["--token-file", &token]].concat();
    let workers = [start(&secured(&worker)), start(&secured(&worker))];
    let addresses = workers.each_ref().map(|worker| worker.address.as_str()).join(",");
    let plain = Solving::start(&bench.scene, &["--threads", "2"]).finish();
    let encrypted = bench.solve(&addresses, &secured(&coordinator));
    assert!(plain.success && encrypted.success, "{}{}", plain.said, encrypted.said);
    assert!(plain.lit == encrypted.lit, "encryption changes the output");
    // By a name of the certificate too, and by another one only when told so.
    let port = workers[0].address.rsplit_once(':').unwrap().1;
    let named = bench.solve(&format!("localhost:{port}"), &secured(&coordinator));
    assert!(named.success, "{}", named.said);
}

/// More workers than the coordinator sends a replica to at a time; how many got one from another worker.
fn passed_among_many(bench: &Bench, of_workers: &[&str], of_coordinator: &[&str]) -> (u64, Option<Vec<u8>>) {
    let workers: Vec<WorkerProcess> = (0..12).map(|_| start(of_workers)).collect();
    let addresses: Vec<&str> = workers.iter().map(|worker| worker.address.as_str()).collect();
    let solved = bench.solve(&addresses.join(","), of_coordinator);
    assert!(solved.success, "{}", solved.said);
    (solved.report["cluster"]["passed_replicas"].as_u64().unwrap(), solved.lit)
}

#[test]
fn workers_pass_replicas_on_with_certificate_and_token_or_not_at_all() {
    let (bench, authority) = (Bench::new(), Authority::new());
    let (worker, coordinator) = (here(&authority), authority.sign(&["coordinator"]));
    let token = bench.file("token", "a-secret-of-many-words");
    let of_workers = [&arguments(&worker)[..], &["--token-file", &token]].concat();
    let of_coordinator = [&arguments(&coordinator)[..], &["--token-file", &token]].concat();
    let (passed, lit) = passed_among_many(&bench, &of_workers, &of_coordinator);
    assert!(passed > 0);
    // Where workers take coordinators alone, these send all.
    let with_roles = [&of_workers[..], &["--tls-callers", "coordinator"]].concat();
    let (passed, same) = passed_among_many(&bench, &with_roles, &of_coordinator);
    assert!(passed == 0 && same == lit);
}

#[test]
fn certificates_that_are_not_right_are_refused() {
    let (bench, authority, other) = (Bench::new(), Authority::new(), Authority::new());
    let (worker, good) = (here(&authority), authority.sign(&["coordinator"]));
    let process = start(&arguments(&worker));

    bench.assert_refused(&process, &[], &["--tls-ca, --tls-cert and --tls-key"]);
    let stranger = other.sign(&["coordinator"]);
    bench.assert_refused(&process, &arguments(&stranger), &["not of the authority in --tls-ca"]);
    let smuggler = TlsFiles { ca: good.ca.clone(), ..stranger };
    bench.assert_refused(&process, &arguments(&smuggler), &["does not accept this end's certificate"]);
    let expired = authority.sign_expired(&["coordinator"]);
    bench.assert_refused(&process, &arguments(&expired), &["certificate has expired"]);

    let elsewhere = start(&arguments(&authority.sign(&["elsewhere"])));
    bench.assert_refused(&elsewhere, &arguments(&good), &["another name", "--tls-name"]);
    let named =
        bench.solve(&elsewhere.address, &[&arguments(&good)[..], &["--tls-name", "elsewhere"]].concat());
    assert!(named.success, "{}", named.said);
    let old = start(&arguments(&authority.sign_expired(&["127.0.0.1"])));
    bench.assert_refused(&old, &arguments(&good), &["certificate has expired"]);
    let plain = start(&[]);
    bench.assert_refused(&plain, &arguments(&good), &["does not speak TLS"]);

    let after = bench.solve(&process.address, &arguments(&good));
    assert!(after.success, "the worker does not live on: {}", after.said);
}

/// A worker's certificate is enough where coordinators show a token: they have none themselves.
#[test]
fn tokens_take_the_place_of_the_callers_certificates() {
    let (bench, authority, other) = (Bench::new(), Authority::new(), Authority::new());
    let worker = here(&authority);
    let token = ["--token-file", &bench.file("token", "right-0123456789")];
    let wrong = ["--token-file", &bench.file("wrong", "wrong-0123456789")];
    let process = start(&[&of_server(&worker)[..], &token].concat());
    let caller = of_caller(&worker);
    let baked = bench.solve(&process.address, &[&caller[..], &token].concat());
    assert!(baked.success, "{}", baked.said);
    // A certificate that nobody asks for does no harm.
    let baked = bench.solve(&process.address, &[&arguments(&worker)[..], &token].concat());
    assert!(baked.success, "{}", baked.said);
    assert!(health(&process.address, &[&caller[..], &token].concat()).0);

    bench.assert_refused(&process, &caller, &["demands a token", "--token-file"]);
    bench.assert_refused(&process, &[&caller[..], &wrong].concat(), &["token is not this worker's"]);
    bench.assert_refused(&process, &token, &["--tls-ca"]);
    // The token goes to no worker that another authority has signed.
    let impostor = other.sign(&["127.0.0.1"]);
    let strangers = [&of_caller(&impostor)[..], &token].concat();
    bench.assert_refused(&process, &strangers, &["not of the authority in --tls-ca"]);
    // Where a certificate is demanded, a token is none.
    let mutual = start(&[&arguments(&worker)[..], &token].concat());
    let without = [&caller[..], &token].concat();
    bench.assert_refused(&mutual, &without, &["demands a certificate: give --tls-cert and --tls-key"]);

    let mut command = Command::new(binary("worker"));
    let refused = command.args(["--listen", "127.0.0.1:0"]).args(of_server(&worker)).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success() && said.contains("give --token-file or --tls-ca"), "{said}");
}

/// A certificate of a client or a worker is none of a coordinator, where the operator says so: by name, or by purpose.
#[test]
fn certificates_have_roles() {
    let (bench, authority) = (Bench::new(), Authority::new());
    let worker = here(&authority);
    let process = start(&[&arguments(&worker)[..], &["--tls-callers", "coordinator,other.example"]].concat());
    let client = authority.sign(&["client"]);
    bench.assert_refused(&process, &arguments(&client), &["--tls-callers"]);
    bench.assert_refused(&process, &arguments(&worker), &["--tls-callers"]);
    let baked = bench.solve(&process.address, &arguments(&authority.sign(&["coordinator"])));
    assert!(baked.success, "{}", baked.said);

    let server_only = authority.sign_for(&["127.0.0.1"], ExtendedKeyUsagePurpose::ServerAuth);
    let caller_only = authority.sign_for(&["coordinator"], ExtendedKeyUsagePurpose::ClientAuth);
    let process = start(&arguments(&server_only));
    bench.assert_refused(&process, &arguments(&server_only), &["does not accept this end's certificate"]);
    let baked = bench.solve(&process.address, &arguments(&caller_only));
    assert!(baked.success, "{}", baked.said);

    let mut command = Command::new(binary("worker"));
    let refused = command.args(["--listen", "127.0.0.1:0", "--tls-callers", "coordinator"]).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success() && said.contains("--tls-ca"), "{said}");
}

/// As many connections as a worker takes, and more, say nothing. A caller with the token still gets a place.
#[test]
fn callers_that_show_nothing_shut_nobody_out() {
    let (bench, authority) = (Bench::new(), Authority::new());
    let token = bench.file("token", "0123456789abcdef");
    let with_token = vec!["--token-file".to_owned(), token];
    let files = |files| arguments(files).map(str::to_owned).to_vec();
    let (worker, coordinator) = (here(&authority), authority.sign(&["coordinator"]));
    let of_both = |files: &[&str]| files.iter().map(ToString::to_string).chain(with_token.clone()).collect();
    let by_token = (of_both(&of_server(&worker)), of_both(&of_caller(&worker)));
    let by_certificate = (files(&worker), files(&coordinator));
    for (worker, coordinator) in [(with_token.clone(), with_token.clone()), by_certificate, by_token] {
        let words = |arguments: &[String]| arguments.iter().map(String::as_str).collect::<Vec<_>>().join(" ");
        let (worker, coordinator) = (words(&worker), words(&coordinator));
        let process = start(&worker.split(' ').collect::<Vec<_>>());
        let mut strangers: Vec<TcpStream> =
            (0..100).map(|_| TcpStream::connect(&process.address).unwrap()).collect();
        // Some of them begin to speak.
        for stranger in strangers.iter_mut().step_by(2) {
            let _ = stranger.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
        }
        let baked = bench.solve(&process.address, &coordinator.split(' ').collect::<Vec<_>>());
        assert!(baked.success, "shut out: {}", baked.said);
    }
}

/// Who shows no token is sent away, whatever else it says; a bake by one who does goes on meanwhile.
#[test]
fn callers_that_show_no_token_are_sent_away() {
    let bench = Bench::new();
    let token = bench.file("token", "0123456789abcdef");
    let process = start(&["--token-file", &token]);
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".as_slice();
    let no_settings = [0, 0, 0, 4, 0, 0, 0, 0, 0];
    for said in [&[], &preface[..10], preface, &[preface, &no_settings].concat()] {
        let begun = Instant::now();
        assert!(answer_to(&process.address, said).len() < 1024);
        // Others may be silent for half a minute.
        assert!(begun.elapsed() < Duration::from_secs(15), "{} bytes, {:?}", said.len(), begun.elapsed());
    }
    let baked = bench.solve(&process.address, &["--token-file", &token]);
    assert!(baked.success, "{}", baked.said);
}

#[test]
fn threads_that_no_system_has_are_refused() {
    let bench = Bench::new();
    let solved = Solving::start(&bench.scene, &["--threads", "100000"]).finish();
    assert!(!solved.success && solved.said.contains("from 1 to 1024"), "{}", solved.said);
    let mut command = Command::new(binary("worker"));
    let refused = command.args(["--threads", "100000"]).output().unwrap();
    assert!(String::from_utf8(refused.stderr).unwrap().contains("from 1 to 1024"));
}

#[test]
fn a_token_is_demanded_and_never_shown() {
    let bench = Bench::new();
    let right = bench.file("right", "right-0123456789");
    let wrong = bench.file("wrong", "wrong-0123456789");
    let process = start(&["--token-file", &right]);
    bench.assert_refused(&process, &[], &["demands a token", "--token-file"]);
    bench.assert_refused(
        &process,
        &["--token-file", &wrong],
        &["token is not this worker's", "--token-file"],
    );
    let baked = bench.solve(&process.address, &["--token-file", &right]);
    assert!(baked.success, "{}", baked.said);
    assert!(!baked.said.contains("0123456789"), "{}", baked.said);
    // Health checks are calls like any other.
    assert!(!health(&process.address, &[]).0);
    assert!(health(&process.address, &["--token-file", &right]).0);
}

#[test]
fn plain_text_beyond_this_machine_is_refused_unless_asked_for() {
    let mut command = Command::new(binary("worker"));
    let refused = command.args(["--listen", "0.0.0.0:0"]).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success());
    for word in ["0.0.0.0:0", "--plaintext", "--tls-ca", "--tls-cert", "--tls-key"] {
        assert!(said.contains(word), "{word} is missing in {said}");
    }
    let asked = WorkerProcess::start_at("0.0.0.0:0", 1, &["--plaintext"]);
    let authority = Authority::new();
    let encrypted = WorkerProcess::start_at("0.0.0.0:0", 1, &arguments(&here(&authority)));
    let bench = Bench::new();
    for (process, files) in [(asked, None), (encrypted, Some(authority.sign(&["coordinator"])))] {
        let port = process.address.rsplit_once(':').unwrap().1;
        let files = files.as_ref().map(arguments);
        let baked = bench.solve(&format!("127.0.0.1:{port}"), files.as_ref().map_or(&[], |files| &files[..]));
        assert!(baked.success, "{}", baked.said);
    }
    // A documentation address, which nobody has: it is refused before it is dialled.
    let far = bench.solve("192.0.2.1:7070", &[]);
    for word in ["192.0.2.1:7070", "plain text", "--plaintext", "--tls-ca"] {
        assert!(!far.success && far.said.contains(word), "{word} is missing in {}", far.said);
    }
}

#[test]
fn files_that_do_not_fit_are_named_at_the_start() {
    let authority = Authority::new();
    let (one, two) = (authority.sign(&["one"]), authority.sign(&["two"]));
    let mixed = TlsFiles { key: two.key.clone(), ..one.clone() };
    let run = |arguments: &[&str]| {
        let output =
            Command::new(binary("worker")).args(["--listen", "127.0.0.1:0"]).args(arguments).output();
        let output = output.unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    let said = run(&arguments(&mixed));
    assert!(said.contains("does not fit") && said.contains(&name(&two.key)), "{said}");
    let said = run(&["--tls-ca", one.ca.to_str().unwrap()]);
    assert!(said.contains("--tls-cert and --tls-key missing"), "{said}");
    let said = run(&["--token-file", one.ca.to_str().unwrap()]);
    assert!(said.contains("no usable token") && !said.contains("BEGIN"), "{said}");
    let said = run(&[&arguments(&one)[..], &["--plaintext"]].concat());
    assert!(said.contains("contradict"), "{said}");
}

/// What comes back until the worker closes the connection.
fn answer_to(address: &str, bytes: &[u8]) -> Vec<u8> {
    let mut socket = TcpStream::connect(address).unwrap();
    socket.set_read_timeout(Some(HANGS)).unwrap();
    // The worker may have heard enough before all of it is said.
    let _ = socket.write_all(bytes);
    let mut answer = vec![];
    match socket.read_to_end(&mut answer) {
        Ok(_) => {}
        Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset),
    }
    answer
}

#[test]
fn garbage_ends_its_own_connection_and_nothing_else() {
    let (bench, authority) = (Bench::new(), Authority::new());
    let (worker, coordinator) = (here(&authority), authority.sign(&["coordinator"]));
    let noise: Vec<u8> = (0..100_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    // The words that HTTP/2 begins with, then frames of all kinds and of lengths that nobody may send.
    let frames = [b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".as_slice(), &[0xff; 4096]].concat();
    let inputs: [&[u8]; 6] = [
        b"GET / HTTP/1.1\r\nHost: worker\r\n\r\n",
        &noise,
        &frames,
        &[0; 64],
        &[0xff; 64],
        b"\x16\x03\x01\xff\xff",
    ];
    for files in [None, Some((&worker, &coordinator))] {
        let process =
            start(files.map(|(worker, _)| arguments(worker)).as_ref().map_or(&[], |files| &files[..]));
        let begun = Instant::now();
        for input in inputs {
            // HTTP/2 settings at most, or an alert of TLS.
            let answer = answer_to(&process.address, input);
            assert!(answer.len() < 1024, "{} bytes for {} of garbage", answer.len(), input.len());
        }
        // A caller that says nothing is sent away too, after some seconds.
        assert!(answer_to(&process.address, b"").len() < 1024);
        assert!(begun.elapsed() < HANGS);
        let files = files.map(|(_, coordinator)| arguments(coordinator));
        let baked = bench.solve(&process.address, files.as_ref().map_or(&[], |files| &files[..]));
        assert!(baked.success, "the worker does not live on: {}", baked.said);
    }
}
