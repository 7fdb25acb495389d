//! The pure solver on enclosures of a few surfaces, each of constant radiosity, with given form factors: against the exact
//! solution of the linear system.

use bake::solver::cache::RowCache;
use bake::solver::shooting::Shooting;
use bake::solver::sweeps::solve;
use bake::solver::{ShareEnergy, ShareId};
use glam::DVec3;
use kernel::row::Row;
use tests::cases::{case, numbers};

/// Accuracy that the sweeps are asked for, and more of them than they need.
const SWEEP_TOLERANCE: f64 = 1e-13;
const MAX_SWEEPS: u32 = 1000;

/// Factors that f32 holds exactly: what is left is where the sweeps end, times the few units by which their bound may be
/// exceeded.
const EXACT_FACTORS: f64 = 1e-12;

struct Enclosure {
    /// `factors[i][j]` is the form factor of surface i to surface j.
    factors: Vec<Vec<f64>>,
    area: Vec<f64>,
    reflectance: Vec<f64>,
    exitance: Vec<f64>,
}

impl Enclosure {
    /// A cube with one emitting face, each face of one radiosity; its opposite is the next face.
    fn cube(reflectance: f64) -> Self {
        let [opposite, adjacent] = case("D00").values()[..] else { panic!("two values") };
        let factor = |i: usize, j: usize| match j {
            _ if i == j => 0.0,
            _ if i / 2 == j / 2 => opposite,
            _ => adjacent,
        };
        Self {
            factors: (0..6).map(|i| (0..6).map(|j| factor(i, j)).collect()).collect(),
            area: vec![1.0; 6],
            reflectance: vec![reflectance; 6],
            exitance: vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        }
    }

    /// The surfaces of a case that lists them.
    fn listed(id: &str) -> Self {
        let case = case(id);
        Self {
            factors: case.geometry("F").as_array().unwrap().iter().map(numbers).collect(),
            area: case.numbers("area"),
            reflectance: case.numbers("rho"),
            exitance: case.numbers("E"),
        }
    }

    fn shares(&self) -> Vec<ShareEnergy> {
        let share = |(receiver, (area, reflectance)): (usize, (&f64, &f64))| ShareEnergy {
            receiver,
            area: *area,
            reflectance: DVec3::splat(*reflectance),
        };
        self.area.iter().zip(&self.reflectance).enumerate().map(share).collect()
    }

    /// Rows as workers send them.
    fn rows(&self) -> Vec<Row> {
        let factors = |shooter: usize| self.factors.iter().map(move |factors| factors[shooter] as f32);
        let row = |shooter| Row::new(&factors(shooter).collect::<Vec<f32>>());
        (0..self.area.len()).map(row).collect()
    }

    /// Irradiance by emission.
    fn direct(&self) -> Vec<DVec3> {
        let sum = |factors: &Vec<f64>| factors.iter().zip(&self.exitance).map(|(f, m)| f * m).sum();
        self.factors.iter().map(|factors| DVec3::splat(sum(factors))).collect()
    }

    /// Radiosity, reflected and emitted, by sweeps from this guess of what is reflected.
    fn swept(&self, guess: Vec<DVec3>) -> Vec<f64> {
        let solution =
            solve(&self.shares(), &mut self.rows(), self.direct(), guess, SWEEP_TOLERANCE, MAX_SWEEPS)
                .unwrap();
        solution
            .radiosity
            .iter()
            .zip(&self.exitance)
            .map(|(reflected, emitted)| reflected.x + emitted)
            .collect()
    }

    /// What the surfaces reflect and shoot until shooting has all rows, and what it says of the rest.
    fn shot(&self) -> (Vec<DVec3>, f64) {
        let rows = self.rows();
        let mut cache = RowCache::new(usize::MAX);
        let set = cache.add_set(rows.len());
        let mut shooting = Shooting::new(self.shares(), self.direct(), set, 1, 0.0);
        let mut wanted = shooting.start(&cache);
        while let Some(share) = wanted.pop() {
            wanted.extend(shooting.row_arrived(share, rows[share.index()].clone(), &mut cache));
        }
        assert!(shooting.is_done());
        let unshot = shooting.progress().unshot;
        (shooting.into_shot(), unshot)
    }

    /// Holds the solution by sweeps alone, and by shooting and sweeps, against this one.
    fn assert_solved(&self, id: &str, expected: &[f64], tolerance: f64) {
        let (shot, unshot) = self.shot();
        // In a closed enclosure what was received is what was emitted and shot.
        let flux = |radiosity: &[DVec3]| radiosity.iter().zip(&self.area).map(|(b, a)| b.x * a).sum::<f64>();
        let received: Vec<DVec3> = (0..self.area.len())
            .map(|i| {
                let sent = |j: usize| self.factors[i][j] * (self.exitance[j] + shot[j].x);
                DVec3::splat(self.reflectance[i] * (0..self.area.len()).map(sent).sum::<f64>())
            })
            .collect();
        let left = 1.0 - flux(&shot) / flux(&received);
        assert!((unshot - left).abs() <= 1e-7, "{id}: {unshot} unshot, expected {left}");
        let from_nothing = vec![DVec3::ZERO; self.area.len()];
        for (way, guess) in [("sweeps", from_nothing), ("shooting and sweeps", shot)] {
            for (found, expected) in self.swept(guess).iter().zip(expected) {
                let error = found / expected - 1.0;
                assert!(
                    error.abs() <= tolerance,
                    "{id} by {way}: {found}, expected {expected}, off by {error:e}"
                );
            }
        }
    }
}

/// Constant radiosity on each face, unlike the continuous cube of `enclosures`. Rows are in f32, half of whose last digit is
/// 6e-8 of a factor; interreflection makes up to 1 / (1 - rho) times that of it.
#[test]
fn cube_of_six_surfaces() {
    for (id, reflectance) in [("D05", 0.5), ("D06", 0.9), ("D07", 0.99)] {
        let [emitter, opposite, side] = case(id).values()[..] else { panic!("three values") };
        let expected = [emitter, opposite, side, side, side, side];
        let tolerance = f64::from(f32::EPSILON) / 2.0 / (1.0 - reflectance);
        Enclosure::cube(reflectance).assert_solved(id, &expected, tolerance);
    }
}

/// Emissions a factor of 1e12 apart.
#[test]
fn plates_of_unequal_emission() {
    Enclosure::listed("D10").assert_solved("D10", &case("D10").values(), EXACT_FACTORS);
}

/// Light is reflected a thousand times. The file rounds the reflectance, which is 1 - 2^-10.
#[test]
fn nearly_white_spheres() {
    let reflectance = vec![1.0 - 2.0_f64.powi(-10); 2];
    let spheres = Enclosure { reflectance, ..Enclosure::listed("D11") };
    spheres.assert_solved("D11", &case("D11").values(), EXACT_FACTORS);
}

/// An endless duct of three equal sides, which see each other by halves.
#[test]
fn triangular_duct() {
    let factor = |i: usize, j: usize| if i == j { 0.0 } else { 0.5 };
    let duct = Enclosure {
        factors: (0..3).map(|i| (0..3).map(|j| factor(i, j)).collect()).collect(),
        area: vec![1.0; 3],
        reflectance: vec![0.1, 0.5, 0.9],
        exitance: vec![1.0, 0.0, 2.0],
    };
    duct.assert_solved("D13", &case("D13").values(), EXACT_FACTORS);
}

/// After k bounces of light in a furnace, the radiosity is the sum of the first k + 1 powers of rho.
///
/// Shooting takes the largest flux first and not all surfaces at once, so it is given a furnace in which each bounce takes
/// all the flux to one other surface: a ring in which surface i sees surface i - 1 alone. The k-th shot is then the k-th
/// bounce, all of it exact in f64.
#[test]
fn bounces_and_what_is_left_of_them() {
    let case = case("D21");
    let [sum, rest] = case.values()[..] else { panic!("two values") };
    let (reflectance, bounces): (f64, usize) = (0.5, 10);
    let surfaces = bounces + 2;
    let mut exitance = vec![0.0; surfaces];
    exitance[surfaces - 1] = 1.0;
    let seen = |i: usize| (i + surfaces - 1) % surfaces;
    let ring = Enclosure {
        factors: (0..surfaces)
            .map(|i| (0..surfaces).map(|j| f64::from(u8::from(j == seen(i)))).collect())
            .collect(),
        area: vec![1.0; surfaces],
        reflectance: vec![reflectance; surfaces],
        exitance,
    };
    let rows = ring.rows();
    let mut cache = RowCache::new(usize::MAX);
    let set = cache.add_set(rows.len());
    let mut shooting = Shooting::new(ring.shares(), ring.direct(), set, 1, 0.0);
    let mut wanted = shooting.start(&cache);
    for (share, row) in (0..).map(ShareId).zip(&rows).take(bounces) {
        assert_eq!(wanted, [share]);
        wanted = shooting.row_arrived(share, row.clone(), &mut cache);
    }
    let progress = shooting.progress();
    assert_eq!(progress.shots, bounces as u64);
    let flux: f64 = 1.0 + shooting.into_shot().iter().map(|shot| shot.x).sum::<f64>();
    assert_eq!(flux, sum);
    // What was reflected is what was shot and what was not yet. The latter grows by 1 / (1 - rho) before it is gone, and so
    // did the emission of 1 into all flux that there is: their ratio is the part that is left.
    let reflected = (flux - 1.0) / (1.0 - progress.unshot);
    let left = progress.unshot * reflected;
    assert!((left / rest - 1.0).abs() <= 1e-15, "{left}");
}
