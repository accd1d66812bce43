//! Failing scenes as files for `lazygrid detect`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use lazygrid::{Interaction, Space, Spheres};
use lazygrid_check::TestInput;
use lazygrid_io::Error;
use lazygrid_io::write::AtomicFile;

/// Returns `None` for species and cells without an option.
pub(super) fn options(path: &Path, scenario: &TestInput) -> Option<String> {
    let space = space_options(&scenario.space).filter(|_| scenario.mixture.is_none())?;
    let mut options = format!("{space} --precision f32");
    if scenario.excluded.is_some() {
        options += &format!(" --exclude {}", excluded(path).display());
    }
    if scenario.groups.is_some() {
        options += " --exclude-groups";
    }
    Some(options)
}

fn excluded(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().display();
    path.with_file_name(format!("{stem}-excluded.csv"))
}

fn space_options(space: &Space) -> Option<String> {
    let vectors = space.cell_vectors();
    if !space.is_periodic() {
        return Some(" --periodic none".to_owned());
    }
    // The diagonal must be positive, and the components above it zero.
    let has_option = |k: usize| {
        vectors[k].is_none_or(|vector| vector[k] > 0.0 && (k + 1..3).all(|axis| vector[axis] == 0.0))
    };
    if !(0..3).all(has_option) {
        return None;
    }
    let length = |k: usize| vectors[k].map_or("-".to_owned(), |vector| format!("{:?}", vector[k]));
    let periodic = format!(" --periodic {}", [0, 1, 2].map(length).join(","));
    let component = |k: usize, axis: usize| format!("{:?}", vectors[k].map_or(0.0, |vector| vector[axis]));
    let tilts = [component(1, 0), component(2, 0), component(2, 1)].join(",");
    Some(if space.triclinic_cell().is_some() { format!("{periodic} --tilt {tilts}") } else { periodic })
}

pub(super) fn write(path: &Path, scenario: &TestInput, comments: &str) -> Result<(), Error> {
    let mut text = String::new();
    let mut comment = |line: &str| text += &format!("# {line}\n");
    comments.lines().for_each(&mut comment);
    if options(path, scenario).is_none() && scenario.space.is_periodic() {
        comment("Space repeats along these cell vectors:");
        for [x, y, z] in scenario.space.cell_vectors().into_iter().flatten() {
            comment(&format!("  {x:?} {y:?} {z:?}"));
        }
    }
    if let Some(mixture) = &scenario.mixture {
        comment("Pairs by species, which lazygrid detect does not know of:");
        for (a, row) in mixture.rows.iter().enumerate() {
            for (b, interaction) in row.iter().enumerate() {
                comment(&match interaction {
                    Interaction::Never => format!("  {a} and {b} never"),
                    Interaction::Touch => format!("  {a} and {b} where they touch"),
                    Interaction::Within(distance) => format!("  {a} and {b} within {distance:?}"),
                });
            }
        }
    }
    let species = scenario.mixture.as_ref().map(|mixture| &mixture.species);
    let groups = scenario.groups.as_ref().map(|groups| molecules(groups));
    text += "x,y,z,r";
    text += if species.is_some() { ",species" } else { "" };
    text += if groups.is_some() { ",group\n" } else { "\n" };
    for (k, sphere) in scenario.spheres.iter().enumerate() {
        let [x, y, z] = sphere.center.to_array();
        let _ = write!(text, "{x:?},{y:?},{z:?},{:?}", sphere.radius);
        for column in [species, groups.as_ref()].into_iter().flatten() {
            let _ = write!(text, ",{}", column[k]);
        }
        text.push('\n');
    }
    commit(path, &text)?;
    let Some(list) = &scenario.excluded else { return Ok(()) };
    let pairs = list.pairs().map(|(i, j)| format!("{i},{j}\n"));
    commit(&excluded(path), &format!("i,j\n{}", pairs.collect::<String>()))
}

fn commit(path: &Path, text: &str) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_with(|out| out.write_all(text.as_bytes()))?;
    file.commit()
}

fn molecules(groups: &[u32]) -> Vec<u32> {
    let mut numbers = BTreeMap::from([(Spheres::NO_GROUP, 0)]);
    let number = |&group: &u32| {
        let next = numbers.len() as u32;
        *numbers.entry(group).or_insert(next)
    };
    groups.iter().map(number).collect()
}
