use std::fmt::{self, Display};

use super::{CompiledKernel, Kernels, Program};
use crate::measure::markdown;

type Row<'a> = (&'a CompiledKernel, &'a Program);

impl Display for Kernels {
    /// Constant columns become a line below the table.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}, {}\n", self.adapter, self.driver)?;
        let rows: Vec<Row<'_>> = self.compiled.iter().flat_map(rows).collect();
        if self.has_statistics {
            let (same, differing) = columns(&rows);
            let header: Vec<_> = ["kernel", "text"].into_iter().chain(differing.iter().copied()).collect();
            let cells = |row: &Row<'_>| {
                let (kernel, text) = (row.0.kernel.to_owned(), row.0.variant.clone());
                [kernel, text].into_iter().chain(differing.iter().map(|name| cell(row, name))).collect()
            };
            f.write_str(&markdown(&header, &rows.iter().map(cells).collect::<Vec<_>>()))?;
            if let Some(first) = rows.first().filter(|_| !same.is_empty()) {
                let constants: Vec<_> =
                    same.iter().map(|name| format!("{name} {}", cell(first, name))).collect();
                writeln!(f, "\nEverywhere: {}.", constants.join(", "))?;
            }
        } else {
            writeln!(f, "The driver reports no statistics: it lacks VK_KHR_pipeline_executable_properties.")?;
        }
        let rejected: Vec<_> = self.rejected().collect();
        writeln!(f, "\n{} kernel variants, {} rejected", self.compiled.len(), rejected.len())?;
        for compiled in rejected {
            let reason = compiled.error.as_deref().unwrap_or_default();
            writeln!(f, "rejected: {}, {}: {reason}", compiled.kernel, compiled.variant)?;
        }
        Ok(())
    }
}

fn rows(compiled: &CompiledKernel) -> impl Iterator<Item = Row<'_>> {
    compiled.programs.iter().map(move |program| (compiled, program))
}

fn columns<'a>(rows: &[Row<'a>]) -> (Vec<&'a str>, Vec<&'a str>) {
    let mut names = vec!["subgroup", "workgroup bytes"];
    for statistic in rows.iter().flat_map(|(_, program)| &program.statistics) {
        let is_hash = statistic.name.to_lowercase().contains("hash");
        if !is_hash && !names.contains(&statistic.name.as_str()) {
            names.push(&statistic.name);
        }
    }
    let is_same =
        |name: &&str| rows.len() > 1 && rows.iter().all(|row| cell(row, name) == cell(&rows[0], name));
    names.into_iter().partition(is_same)
}

fn cell((compiled, program): &Row<'_>, name: &str) -> String {
    let found = program.statistics.iter().find(|statistic| statistic.name == name);
    match (name, found) {
        ("subgroup", _) => program.subgroup.to_string(),
        ("workgroup bytes", _) => compiled.workgroup_memory.to_string(),
        (_, Some(statistic)) => statistic.value.to_string(),
        (_, None) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Number, Statistic};
    use super::*;

    fn compiled(kernel: &'static str, registers: u64) -> CompiledKernel {
        let named =
            |(name, value): (&str, u64)| Statistic { name: name.to_owned(), value: Number::Whole(value) };
        let statistics = [("Registers", registers), ("Spills", 0), ("Hash", registers)].map(named).to_vec();
        let program = Program { name: "CS".to_owned(), subgroup: 32, statistics, texts: Vec::new() };
        let variant = "plain".to_owned();
        CompiledKernel { kernel, variant, workgroup_memory: 64, programs: vec![program], error: None }
    }

    #[test]
    fn constant_columns_become_a_line() {
        let rejected = CompiledKernel {
            programs: Vec::new(),
            error: Some("VK_ERROR".to_owned()),
            ..compiled("radix_count", 0)
        };
        let kernels = Kernels {
            adapter: "Card".to_owned(),
            driver: "driver 1".to_owned(),
            has_statistics: true,
            compiled: vec![compiled("scan_once", 24), compiled("cell_starts_find", 8), rejected],
        };
        let expected = "Card, driver 1

| kernel | text | Registers |
| --- | --- | --- |
| scan_once | plain | 24 |
| cell_starts_find | plain | 8 |

Everywhere: subgroup 32, workgroup bytes 64, Spills 0.

3 kernel variants, 1 rejected
rejected: radix_count, plain: VK_ERROR
";
        assert_eq!(kernels.to_string(), expected);
    }
}
