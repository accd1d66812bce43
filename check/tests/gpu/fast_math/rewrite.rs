//! Rewrites WGSL like compilers for which floating-point operations are associative and fusible.

use std::ops::Range;

use naga::valid::{
    Capabilities, FunctionInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator,
};
use naga::{BinaryOperator, Expression, Function, Handle, MathFunction, Module, ScalarKind, TypeInner};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Rewrite {
    /// `(a - b) + (c - d)` becomes `(a + c) - (b + d)`.
    Reassociate,
    /// `a * c + b * c` becomes `(a + b) * c`.
    Factor,
    /// `(a + b) * c` becomes `a * c + b * c`.
    Distribute,
    /// `a * b + c` becomes `fma(a, b, c)`.
    Contract,
    /// Subnormal results become 0.
    Flush,
}

pub(crate) fn rewritten(text: &str, rewrites: &[Rewrite]) -> String {
    let mut text = text.to_owned();
    for &rewrite in rewrites {
        if rewrite == Rewrite::Flush {
            text = flushed(&text);
            continue;
        }
        for _ in 0..6 {
            let edits = analyzed(&text, |scope| scope.edits(rewrite));
            if edits.is_empty() {
                break;
            }
            text = edited(&text, edits);
        }
    }
    text
}

type Edit = (Range<usize>, String);

fn analyzed<T>(text: &str, visit: impl Fn(&Scope<'_>) -> Vec<T>) -> Vec<T> {
    let module = naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    validator.subgroup_stages(ShaderStages::all());
    validator.subgroup_operations(SubgroupOperationSet::all());
    let info = validator.validate(&module).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    let entries = module.entry_points.iter().enumerate();
    let entries = entries.map(|(number, entry)| (&entry.function, info.get_entry_point(number)));
    let scopes =
        functions.chain(entries).map(|(function, info)| Scope { text, module: &module, function, info });
    scopes.flat_map(|scope| visit(&scope)).collect()
}

fn edited(text: &str, mut edits: Vec<Edit>) -> String {
    edits.sort_by_key(|(range, _)| (range.start, std::cmp::Reverse(range.end)));
    let (mut result, mut end) = (String::new(), 0);
    for (range, new) in edits {
        if range.start >= end {
            result += &text[end..range.start];
            result += &new;
            end = range.end;
        }
    }
    result + &text[end..]
}

fn flushed(text: &str) -> String {
    let ranges = analyzed(text, |scope| scope.operations());
    let mut marks: Vec<(usize, bool, usize, u32)> = Vec::new();
    for (range, width) in ranges {
        marks.push((range.start, true, range.end, width));
        marks.push((range.end, false, range.start, width));
    }
    // Closing marks come first; of two that open at one position, the outer one.
    marks.sort_by_key(|&(at, opens, other, _)| (at, opens, std::cmp::Reverse(other)));
    let (mut result, mut end) = (String::new(), 0);
    for (at, opens, _, width) in marks {
        result += &text[end..at];
        result += &if opens { format!("flushed_{width}(") } else { ")".to_owned() };
        end = at;
    }
    result += &text[end..];
    for (width, kind, zero, least) in [
        (1, "f32", "0.0", "0x1p-126"),
        (2, "vec2<f32>", "vec2(0.0)", "vec2(0x1p-126)"),
        (3, "vec3<f32>", "vec3(0.0)", "vec3(0x1p-126)"),
        (4, "vec4<f32>", "vec4(0.0)", "vec4(0x1p-126)"),
    ] {
        result += &format!(
            "fn flushed_{width}(x: {kind}) -> {kind} {{ return select(x, {zero}, abs(x) < {least}); }}\n"
        );
    }
    result
}

struct Scope<'a> {
    text: &'a str,
    module: &'a Module,
    function: &'a Function,
    info: &'a FunctionInfo,
}

type Value = Handle<Expression>;

impl Scope<'_> {
    fn edits(&self, rewrite: Rewrite) -> Vec<Edit> {
        let values = self.function.expressions.iter().map(|(value, _)| value);
        let edit = |value| Some((self.operation(value)?, self.rewritten(value, rewrite)?));
        values.filter_map(edit).collect()
    }

    fn operations(&self) -> Vec<(Range<usize>, u32)> {
        let mut found = Vec::new();
        for (value, expression) in self.function.expressions.iter() {
            use BinaryOperator::{Add, Divide, Multiply, Subtract};
            let is_operation =
                matches!(expression, Expression::Binary { op: Add | Subtract | Multiply | Divide, .. })
                    || matches!(expression, Expression::Math { fun: MathFunction::Fma, .. });
            if let (true, Some(width), Some(range)) = (is_operation, self.width(value), self.operation(value))
            {
                found.push((range, width));
            }
        }
        found.sort_by_key(|(range, _)| (range.start, range.end));
        found.dedup();
        found
    }

    fn rewritten(&self, value: Value, rewrite: Rewrite) -> Option<String> {
        use BinaryOperator::{Add, Multiply, Subtract};
        let width = self.width(value)?;
        let (op, left, right) = self.binary(value)?;
        match rewrite {
            Rewrite::Reassociate => match (op, self.inner(value, left), self.inner(value, right)) {
                (Add, Some((Subtract, a, b)), Some((Subtract, c, d))) => {
                    self.joined(width, [a, b, c, d], |[a, b, c, d]| format!("({a} + {c}) - ({b} + {d})"))
                }
                (Add, Some((Subtract, a, b)), _) => {
                    self.joined(width, [a, b, right], |[a, b, c]| format!("({a} + {c}) - {b}"))
                }
                (Add, _, Some((Subtract, a, b))) => {
                    self.joined(width, [left, a, b], |[c, a, b]| format!("({c} + {a}) - {b}"))
                }
                (Subtract, Some((Subtract, a, b)), _) => {
                    self.joined(width, [a, b, right], |[a, b, c]| format!("{a} - ({b} + {c})"))
                }
                (Add, _, Some((Add, b, c))) => {
                    self.joined(width, [left, b, c], |[a, b, c]| format!("({a} + {b}) + {c}"))
                }
                _ => None,
            },
            Rewrite::Factor => {
                let (Some((Multiply, a, c)), Some((Multiply, b, d))) =
                    (self.inner(value, left), self.inner(value, right))
                else {
                    return None;
                };
                let sign = sign(op)?;
                let pairs = [(a, c, b, d), (a, c, d, b), (c, a, b, d), (c, a, d, b)];
                let (a, c, b, _) =
                    pairs.into_iter().find(|(_, c, _, d)| self.source(*c) == self.source(*d))?;
                self.joined(width, [a, b, c], |[a, b, c]| format!("({a} {sign} {b}) * {c}"))
            }
            Rewrite::Distribute if op == Multiply => {
                let (inner, c) = match (self.inner(value, left), self.inner(value, right)) {
                    (Some(inner @ (Add | Subtract, ..)), _) => (inner, right),
                    (_, Some(inner @ (Add | Subtract, ..))) => (inner, left),
                    _ => return None,
                };
                let (op, a, b) = inner;
                let sign = sign(op)?;
                self.joined(width, [a, b, c], |[a, b, c]| format!("{a} * {c} {sign} {b} * {c}"))
            }
            Rewrite::Contract => match (op, self.inner(value, left), self.inner(value, right)) {
                (Add, Some((Multiply, a, b)), _) => {
                    self.joined(width, [a, b, right], |[a, b, c]| format!("fma({a}, {b}, {c})"))
                }
                (Add, _, Some((Multiply, a, b))) => {
                    self.joined(width, [a, b, left], |[a, b, c]| format!("fma({a}, {b}, {c})"))
                }
                (Subtract, Some((Multiply, a, b)), _) => {
                    self.joined(width, [a, b, right], |[a, b, c]| format!("fma({a}, {b}, -{c})"))
                }
                (Subtract, _, Some((Multiply, a, b))) => {
                    self.joined(width, [a, b, left], |[a, b, c]| format!("fma(-{a}, {b}, {c})"))
                }
                _ => None,
            },
            Rewrite::Distribute | Rewrite::Flush => None,
        }
    }

    fn joined<const N: usize>(
        &self,
        width: u32,
        operands: [Value; N],
        format: impl Fn([String; N]) -> String,
    ) -> Option<String> {
        let texts = operands.map(|operand| {
            let text = self.source(operand)?;
            Some(match self.width(operand)? {
                own if own == width => format!("({text})"),
                _ => format!("vec{width}<f32>({text})"),
            })
        });
        texts
            .iter()
            .all(Option::is_some)
            .then(|| format!("({})", format(texts.map(Option::unwrap_or_default))))
    }

    fn binary(&self, value: Value) -> Option<(BinaryOperator, Value, Value)> {
        match self.function.expressions[value] {
            Expression::Binary { op, left, right } => Some((op, left, right)),
            _ => None,
        }
    }

    fn inner(&self, user: Value, operand: Value) -> Option<(BinaryOperator, Value, Value)> {
        self.width(operand)?;
        let (op, left, right) = self.binary(operand)?;
        let (outer, own) = (self.range(user)?, self.range(operand)?);
        let is_nested = outer.start <= own.start && own.end <= outer.end;
        (is_nested || (self.is_repeatable(left) && self.is_repeatable(right))).then_some((op, left, right))
    }

    /// Returns `true` for values of arguments, constants and read-only buffers alone.
    fn is_repeatable(&self, value: Value) -> bool {
        match self.function.expressions[value] {
            Expression::Literal(_) | Expression::Constant(_) | Expression::FunctionArgument(_) => true,
            Expression::Binary { left, right, .. } => self.is_repeatable(left) && self.is_repeatable(right),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => self.is_repeatable(expr),
            Expression::Splat { value, .. } => self.is_repeatable(value),
            Expression::Swizzle { vector, .. } => self.is_repeatable(vector),
            Expression::Math { arg, arg1, arg2, .. } => {
                [Some(arg), arg1, arg2].into_iter().flatten().all(|arg| self.is_repeatable(arg))
            }
            Expression::AccessIndex { base, .. } => self.is_repeatable(base),
            Expression::Load { pointer } => self.is_uniform(pointer),
            _ => false,
        }
    }

    fn is_uniform(&self, pointer: Value) -> bool {
        match self.function.expressions[pointer] {
            Expression::GlobalVariable(global) => {
                self.module.global_variables[global].space == naga::AddressSpace::Uniform
            }
            Expression::AccessIndex { base, .. } | Expression::Access { base, .. } => self.is_uniform(base),
            _ => false,
        }
    }

    fn width(&self, value: Value) -> Option<u32> {
        match *self.info[value].ty.inner_with(&self.module.types) {
            TypeInner::Scalar(scalar) if scalar.kind == ScalarKind::Float => Some(1),
            TypeInner::Vector { size, scalar } if scalar.kind == ScalarKind::Float => Some(size as u32),
            _ => None,
        }
    }

    fn operation(&self, value: Value) -> Option<Range<usize>> {
        let range = self.range(value)?;
        let text = &self.text[range.clone()];
        let is_assignment = ["+= ", "-= ", "*= ", "/= "].iter().any(|sign| text.contains(sign));
        (!is_assignment).then_some(range)
    }

    /// naga's span of a call ends before its arguments.
    fn range(&self, value: Value) -> Option<Range<usize>> {
        let range = self.function.expressions.get_span(value).to_range().filter(|range| !range.is_empty())?;
        let mut depth = 0;
        for (at, c) in self.text[range.end..].char_indices() {
            match c {
                '(' => depth += 1,
                ')' if depth == 1 => return Some(range.start..range.end + at + 1),
                ')' if depth > 1 => depth -= 1,
                _ if depth == 0 => return Some(range),
                _ => {}
            }
        }
        None
    }

    fn source(&self, value: Value) -> Option<String> {
        match self.function.expressions[value] {
            // naga gives converted literals no span.
            Expression::Literal(naga::Literal::F32(number)) => Some(format!("{number:?}f")),
            _ => Some(self.text[self.range(value)?].to_owned()),
        }
    }
}

fn sign(op: BinaryOperator) -> Option<char> {
    match op {
        BinaryOperator::Add => Some('+'),
        BinaryOperator::Subtract => Some('-'),
        _ => None,
    }
}
