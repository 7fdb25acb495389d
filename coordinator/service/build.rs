//! Builds the page of the service (`coordinator/web`) with npm, in a copy under `OUT_DIR`, for the program to embed.
//!
//! Node is optional: without it, or without a registry to install from, the program embeds a plain page, and a warning says how to
//! get the full one. `HALFLIGHT_PAGE` overrides this:
//!
//! | `HALFLIGHT_PAGE` | result |
//! |---|---|
//! | not set | the full page if it can be built, else the plain one |
//! | `off` | the plain page |
//! | `required` | the full page, or the build fails |
//! | a folder | the page built there (`npm ci && npm run build` in `web/` makes `web/dist`) |

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

/// Folder of the page.
const WEB: &str = "../web";

/// Sources of the page; not the whole folder, which may contain installed packages.
const SOURCES: [&str; 6] =
    ["index.html", "package.json", "package-lock.json", "vite.config.ts", "public", "src"];

/// The plain page.
const PLAIN: &str = "src/http/plain.html";

/// Gives up soon on a registry that does not answer: the plain page will do.
const INSTALL: [&str; 8] = [
    "ci",
    "--omit=dev",
    "--ignore-scripts",
    "--no-audit",
    "--no-fund",
    "--fetch-retries=1",
    "--fetch-retry-mintimeout=1000",
    "--fetch-timeout=20000",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-env-changed=HALFLIGHT_PAGE");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={PLAIN}");
    for source in SOURCES {
        println!("cargo:rerun-if-changed={WEB}/{source}");
    }
    let folder = PathBuf::from(env::var("OUT_DIR")?);
    let page = folder.join("page");
    let choice = env::var("HALFLIGHT_PAGE").unwrap_or_default();
    let built = match choice.as_str() {
        "off" => return plain(&page),
        "" | "required" => build(&folder.join("web"), &page),
        elsewhere => {
            println!("cargo:rerun-if-changed={elsewhere}");
            clear(&page).and_then(|()| copy(Path::new(elsewhere), &page)).map_err(Into::into)
        }
    };
    match built {
        Ok(()) => Ok(()),
        Err(error) if !choice.is_empty() => {
            Err(format!("cannot build the page of the service (HALFLIGHT_PAGE={choice}): {error}").into())
        }
        Err(error) => {
            println!(
                "cargo:warning=the service gets a plain page, without the viewer: {error}; for the viewer install Node 20.19 or \
                 later with npm and build again with HALFLIGHT_PAGE=required, or set HALFLIGHT_PAGE=off to do without"
            );
            plain(&page)
        }
    }
}

/// Builds the page in `copy` and puts it into `page`.
fn build(copy_of_web: &Path, page: &Path) -> Result<(), Box<dyn Error>> {
    check_node()?;
    fs::create_dir_all(copy_of_web)?;
    // Installs only when the lock file has changed: it takes longest.
    let lock = "package-lock.json";
    let installed = copy_of_web.join("node_modules").join(".installed");
    let wanted = fs::read(Path::new(WEB).join(lock))?;
    let is_installed = fs::read(&installed).is_ok_and(|lock| lock == wanted);
    for source in SOURCES {
        let to = copy_of_web.join(source);
        if to.is_dir() {
            fs::remove_dir_all(&to)?;
        }
        copy(&Path::new(WEB).join(source), &to)?;
    }
    if !is_installed {
        npm(copy_of_web, &INSTALL)?;
        fs::write(&installed, wanted)?;
    }
    npm(copy_of_web, &["run", "build"])?;
    clear(page)?;
    fs::rename(copy_of_web.join("dist"), page)?;
    Ok(())
}

/// Puts the plain page into `page`.
fn plain(page: &Path) -> Result<(), Box<dyn Error>> {
    clear(page)?;
    fs::create_dir_all(page)?;
    fs::copy(PLAIN, page.join("index.html"))?;
    Ok(())
}

/// Checks the version that Vite requires: Node 20.19 or later of 20, or 22.12 or later.
fn check_node() -> Result<(), Box<dyn Error>> {
    let output =
        Command::new("node").arg("--version").output().map_err(|error| format!("no Node: {error}"))?;
    let version = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let mut numbers =
        version.trim_start_matches('v').split('.').map_while(|number| number.parse::<u32>().ok());
    match (numbers.next(), numbers.next()) {
        (Some(20), Some(19..)) | (Some(22), Some(12..)) | (Some(23..), _) => Ok(()),
        _ => Err(format!("Node {version} is too old").into()),
    }
}

/// Runs npm; the error has its first error line.
fn npm(folder: &Path, arguments: &[&str]) -> Result<(), Box<dyn Error>> {
    let program = if cfg!(windows) { "npm.cmd" } else { "npm" };
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .map_err(|error| format!("no npm: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    let line = said.lines().find(|line| line.to_lowercase().contains("error")).unwrap_or("no message");
    Err(format!("npm {} fails: {}", arguments[..arguments.len().min(2)].join(" "), line.trim()).into())
}

/// Removes a folder, if it exists.
fn clear(folder: &Path) -> io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Copies a file or a folder, recursively.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    if !from.is_dir() {
        return fs::copy(from, to).map(drop);
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        copy(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}
