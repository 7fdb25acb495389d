# What is done often. `just` lists it.

[private]
default:
    @just --list

# Build both programs.
build:
    cargo build --release -p coordinator -p worker

# The tests, as the README runs them.
test *arguments:
    cargo test --release --workspace {{ arguments }}

# Formatting, clippy and documentation, with warnings denied.
lint:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets --locked -- -D warnings
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked

# Licences, advisories and sources of the dependencies, and those that nobody uses (needs cargo-deny and cargo-machete).
dependencies:
    cargo deny check
    cargo machete

# Fuzz importer, images, row_codec, clipper, jobs, replicas, answers or submissions for some seconds (needs cargo-fuzz and a nightly compiler).
fuzz target seconds="60":
    FUZZ_SECONDS={{ seconds }} .ci/fuzz {{ target }}

# All that a change must pass.
ci:
    .ci/run

# Bake a scene of tests/scenes: target/NAME-lit.glb and target/NAME-report.json.
bake name="cornell" *arguments:
    cargo run --release -p coordinator -- solve tests/scenes/{{ name }}.glb -o target/{{ name }}-lit.glb \
        --report target/{{ name }}-report.json {{ arguments }}

# Error over time, knob by knob, for a scene of tests/scenes: target/study/NAME/study.{csv,svg,md}. Wants a quiet machine.
study name="cornell" *arguments:
    cargo run --release -p coordinator -- study tests/scenes/{{ name }}.glb \
        --reference tests/references/{{ name }}.reference.csv -o target/study/{{ name }} {{ arguments }}

# How long the kernels take, crate by crate; `just bench rays` those whose name has it.
bench *filter:
    cargo bench --workspace -- {{ filter }}

# This program beside Mitsuba and Cycles, at the same errors: target/bench/peers.json (needs Python; wants a quiet machine).
bench-peers *arguments:
    tests/bench/compare {{ arguments }}

# Rays beside Embree's: target/bench/rays.json (needs Python with embreex).
bench-rays *arguments:
    tests/bench/rays {{ arguments }}

# Errors and times of bakes, written to the table in docs/figures.md (wants a quiet machine).
figures *arguments:
    tests/bench/figures {{ arguments }}

# How a bake scales with workers, simulated with the real scheduler, solver and rows: efficiency by workers, small, medium and large.
scale *scenes:
    cargo measure scale -- scale {{ scenes }}

# The experiments of the paper, simulated: who shoots, event-driven versus periodic scheduling; and energies apart or in the vertices, measured.
paper *scenes:
    cargo measure scale -- paper {{ scenes }}

# Two workers beside one, over a link, and with a slow one: target/bench/cluster.json (needs root; wants a quiet machine).
bench-cluster *arguments:
    tests/bench/cluster {{ arguments }}

# Scenes that ask for trouble, baked and cancelled for so many seconds; those that break a promise go to target/nasty.
nasty seconds="600" triangles="2000" *arguments:
    cargo build --release -p coordinator
    cargo measure nasty -- {{ seconds }} {{ triangles }} {{ arguments }}

# A service under load: how long calls take while it bakes, and what memory it has. Wants a quiet machine.
storm seconds="60":
    cargo build --release -p coordinator
    cargo measure storm -- {{ seconds }}

# A picture of a baked scene by the program itself: target/NAME-render.png.
render name="cornell" *arguments:
    cargo run --release -p coordinator -- render target/{{ name }}-lit.glb -o target/{{ name }}-render.png {{ arguments }}

# The pictures of README and docs, from the scenes of the repository: docs/pictures.
pictures:
    cargo build --release -p coordinator
    tests/pictures target/release/coordinator

# A picture of a baked scene in a browser: target/NAME.png (needs Node and chromium).
picture name="cornell" *arguments: node
    node tests/node/picture.mjs target/{{ name }}-lit.glb target/{{ name }}.png {{ arguments }}

# The page of the service in a headless browser (needs Node and chromium).
page:
    npm ci --prefix coordinator/web --ignore-scripts --no-audit --no-fund
    npm run --prefix coordinator/web check
    npm ci --prefix tests/page --no-audit --no-fund
    HALFLIGHT_PAGE=required cargo build --release -p coordinator
    npm test --prefix tests/page

# The page while it is worked on, in front of a service on this machine: http://localhost:5173 (needs Node).
page-dev service="http://127.0.0.1:7000":
    npm install --prefix coordinator/web --no-audit --no-fund
    HALFLIGHT_SERVICE={{ service }} npm run --prefix coordinator/web dev

# A baked scene through the Khronos validator (needs Node).
validate name="cornell": node
    node tests/node/validate.mjs target/{{ name }}-lit.glb

[private]
node:
    npm ci --prefix tests/node --no-audit --no-fund
