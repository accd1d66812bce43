//! Every loop of every kernel ends, by a bound that its text shows. In accepted loops, only the update changes the
//! counter:
//! * `for (var k = a; k < b; k++)`, also downward or with a constant step or factor, if `b` is constant in the loop and
//!   the counter cannot wrap past it;
//! * `for (; bits != 0u; bits &= bits - 1u)`.

mod texts;

use std::collections::HashSet;

use lazygrid_kernels::kernel::Kernel;
use naga::{
    AddressSpace, BinaryOperator, Block, Expression, Function, Handle, Literal, LocalVariable, Module,
    Statement, StorageAccess,
};

type Value = Handle<Expression>;

/// Returns the number of loops, and the faults.
fn judge(source: &str) -> (usize, Vec<String>) {
    let module =
        naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    let (mut loops, mut faults) = (0, Vec::new());
    for function in module.functions.iter().map(|(_, function)| function).chain(entries) {
        let scope = Scope { module: &module, function };
        scope.each_loop(&function.body, &mut |before, body, continuing, line_of| {
            loops += 1;
            if let Err(fault) = scope.bound(before, body, continuing) {
                faults.push(format!("line {}: {fault}", line_of(source)));
            }
        });
    }
    (loops, faults)
}

struct Scope<'a> {
    module: &'a Module,
    function: &'a Function,
}

type Visit<'a> = dyn FnMut(&[Statement], &Block, &Block, &dyn Fn(&str) -> u32) + 'a;

impl Scope<'_> {
    fn each_loop(&self, block: &Block, visit: &mut Visit<'_>) {
        for (at, (statement, span)) in block.span_iter().enumerate() {
            if let Statement::Loop { body, continuing, .. } = statement {
                visit(&block[..at], body, continuing, &|source| span.location(source).line_number);
            }
            for inner in blocks_of(statement) {
                self.each_loop(inner, visit);
            }
        }
    }

    fn bound(&self, before: &[Statement], body: &Block, continuing: &Block) -> Result<(), &'static str> {
        let mut head = body.iter().filter(|statement| !matches!(statement, Statement::Emit(_)));
        let Some(Statement::If { condition, accept, reject }) = head.next() else {
            return Err("it does not begin with a single comparison");
        };
        let (Expression::Binary { op, left, right }, [], [Statement::Break]) =
            (self.expression(*condition), &accept[..], &reject[..])
        else {
            return Err("it does not begin with a single comparison");
        };
        let Expression::Load { pointer } = self.expression(*left) else {
            return Err("it compares no counter");
        };
        let &Expression::LocalVariable(variable) = self.expression(*pointer) else {
            return Err("it compares no counter");
        };
        let updates: Vec<_> = continuing.iter().filter(|s| !matches!(s, Statement::Emit(_))).collect();
        let [Statement::Store { pointer, value }] = updates[..] else {
            return Err("it has not one update");
        };
        if self.expression(*pointer) != &Expression::LocalVariable(variable) {
            return Err("its update is not of its counter");
        }
        if self.changes(body, variable) {
            return Err("its body changes the counter");
        }
        let limit =
            Limit { constant: self.constant(*right), fixed: self.is_fixed(*right, [body, continuing]) };
        let counter = Counter { variable, start: self.start(before, variable) };
        self.ends(*op, *value, counter, &limit)
    }

    fn ends(
        &self,
        op: BinaryOperator,
        update: Value,
        counter: Counter,
        limit: &Limit,
    ) -> Result<(), &'static str> {
        use BinaryOperator::{Add, And, Divide, Greater, Less, LessEqual, Multiply, NotEqual, Subtract};
        let Expression::Binary { op: change, left, right } = *self.expression(update) else {
            return Err("its update is neither a step nor the clearing of a bit");
        };
        let is_counter = |value: Value| {
            matches!(self.expression(value), &Expression::Load { pointer }
                if self.expression(pointer) == &Expression::LocalVariable(counter.variable))
        };
        if !is_counter(left) {
            return Err("its update does not begin with its counter");
        }
        if !limit.fixed {
            return Err("its limit may change while it runs");
        }
        let step = self.constant(right);
        let lowest_cleared = matches!(*self.expression(right), Expression::Binary { op: Subtract, left, right }
            if is_counter(left) && self.constant(right) == Some(1));
        let fits = |step: u32| limit.constant.is_some_and(|most| most.checked_add(step).is_some());
        let grows = |by: u32| limit.constant.is_some_and(|most| most.checked_mul(by).is_some());
        let ends = match (op, change, step) {
            (NotEqual, And, _) => limit.constant == Some(0) && lowest_cleared,
            (Less, Add, Some(1)) => true,
            (Less | LessEqual, Add, Some(step)) => step > 0 && fits(step),
            (Less, Multiply, Some(by)) => by > 1 && grows(by) && counter.start.is_some_and(|start| start > 0),
            (Greater, Subtract, Some(1)) => true,
            (Greater, Divide, Some(by)) => by > 1,
            _ => false,
        };
        if ends { Ok(()) } else { Err("its counter may pass the limit, or never come to it") }
    }

    fn expression(&self, value: Value) -> &Expression {
        &self.function.expressions[value]
    }

    fn constant(&self, value: Value) -> Option<u32> {
        let literal = match *self.expression(value) {
            Expression::Constant(constant) => {
                &self.module.global_expressions[self.module.constants[constant].init]
            }
            ref other => other,
        };
        match *literal {
            Expression::Literal(Literal::U32(value)) => Some(value),
            _ => None,
        }
    }

    fn start(&self, before: &[Statement], counter: Handle<LocalVariable>) -> Option<u32> {
        let stored = before.iter().rev().find_map(|statement| match statement {
            Statement::Store { pointer, value }
                if self.expression(*pointer) == &Expression::LocalVariable(counter) =>
            {
                Some(*value)
            }
            _ => None,
        });
        self.constant(stored.or(self.function.local_variables[counter].init)?)
    }

    fn changes(&self, block: &Block, variable: Handle<LocalVariable>) -> bool {
        let names_it = |value: &Value| self.root(*value) == &Expression::LocalVariable(variable);
        block.iter().any(|statement| {
            let here = match statement {
                Statement::Store { pointer, .. } | Statement::Atomic { pointer, .. } => names_it(pointer),
                Statement::Call { arguments, .. } => arguments.iter().any(&names_it),
                _ => false,
            };
            here || blocks_of(statement).any(|inner| self.changes(inner, variable))
        })
    }

    fn root(&self, value: Value) -> &Expression {
        match self.expression(value) {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.root(*base),
            other => other,
        }
    }

    /// Returns `true` if no iteration changes the value.
    fn is_fixed(&self, value: Value, blocks: [&Block; 2]) -> bool {
        let mut made_inside = HashSet::new();
        blocks.iter().for_each(|block| collect_made(block, &mut made_inside));
        self.is_made_of_fixed(value, &made_inside, blocks)
    }

    fn is_made_of_fixed(&self, value: Value, inside: &HashSet<Value>, blocks: [&Block; 2]) -> bool {
        let fixed = |value: &Value| self.is_made_of_fixed(*value, inside, blocks);
        if !inside.contains(&value) {
            return true;
        }
        match self.expression(value) {
            Expression::Binary { left, right, .. } => fixed(left) && fixed(right),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => fixed(expr),
            Expression::AccessIndex { base, .. } => fixed(base),
            Expression::Access { base, index } => fixed(base) && fixed(index),
            Expression::Load { pointer } => match *self.root(*pointer) {
                Expression::GlobalVariable(global) => match self.module.global_variables[global].space {
                    AddressSpace::Uniform => fixed(pointer),
                    AddressSpace::Storage { access } => {
                        !access.contains(StorageAccess::STORE) && fixed(pointer)
                    }
                    _ => false,
                },
                Expression::LocalVariable(local) => {
                    blocks.iter().all(|block| !self.changes(block, local)) && fixed(pointer)
                }
                _ => false,
            },
            Expression::ArrayLength(_) => true,
            _ => false,
        }
    }
}

struct Counter {
    variable: Handle<LocalVariable>,
    start: Option<u32>,
}

struct Limit {
    constant: Option<u32>,
    fixed: bool,
}

fn blocks_of(statement: &Statement) -> impl Iterator<Item = &Block> {
    let (two, cases): (Vec<&Block>, &[naga::SwitchCase]) = match statement {
        Statement::Block(block) => (vec![block], &[]),
        Statement::If { accept, reject, .. } => (vec![accept, reject], &[]),
        Statement::Loop { body, continuing, .. } => (vec![body, continuing], &[]),
        Statement::Switch { cases, .. } => (Vec::new(), cases),
        _ => (Vec::new(), &[]),
    };
    two.into_iter().chain(cases.iter().map(|case| &case.body))
}

fn collect_made(block: &Block, made: &mut HashSet<Value>) {
    for statement in block.iter() {
        match statement {
            Statement::Emit(range) => made.extend(range.clone()),
            Statement::Atomic { result, .. } | Statement::Call { result, .. } => made.extend(*result),
            Statement::WorkGroupUniformLoad { result, .. }
            | Statement::SubgroupBallot { result, .. }
            | Statement::SubgroupGather { result, .. }
            | Statement::SubgroupCollectiveOperation { result, .. } => {
                made.insert(*result);
            }
            _ => {}
        }
        blocks_of(statement).for_each(|inner| collect_made(inner, made));
    }
}

#[test]
fn every_loop_has_a_bound_that_its_text_shows() {
    let (mut loops, mut faults) = (0, Vec::new());
    for text in texts::all(Kernel::wgsl) {
        let (found, wrong) = judge(&text.wgsl);
        loops += found;
        faults.extend(wrong.into_iter().map(|fault| format!("{}, {fault}", text.name)));
    }
    assert!(faults.is_empty(), "loops without a bound:\n{}", faults.join("\n"));
    assert!(loops > 100, "only {loops} loops were seen");
}

fn verdict(loops: &str) -> (usize, Vec<String>) {
    judge(&format!(
        "struct Call {{ limit: u32 }}
        @group(0) @binding(0) var<uniform> call: Call;
        @group(0) @binding(1) var<storage, read> given: array<u32>;
        @group(0) @binding(2) var<storage, read_write> found: array<u32>;
        var<workgroup> shared_one: u32;
        fn stepped(counter: ptr<function, u32>) {{ *counter += 1u; }}
        fn f(n: u32) {{ var a = n; {loops} }}"
    ))
}

#[test]
fn loops_with_a_bound_are_accepted() {
    for good in [
        "for (var k = 0u; k < 32u; k++) { a += k; }",
        "for (var k = 7u; k < n; k++) { a += k; }",
        "for (var k = 0u; k < call.limit / 4u + 1u; k++) { for (var j = k; j < n; j++) { continue; } }",
        "for (var k = 0u; k < given[n]; k++) { if (found[k] == 0u) { break; } }",
        "for (var k = 0u; k < arrayLength(&found); k++) { found[k] = 0u; }",
        "let most = found[0]; for (var k = 0u; k < most; k++) { found[k] = 0u; }",
        "for (var k = 0u; k < a; k++) { found[k] = 0u; }",
        "for (var k = 1u; k < 256u; k *= 2u) { workgroupBarrier(); }",
        "for (var k = 128u; k > 0u; k /= 2u) { workgroupBarrier(); }",
        "for (var k = n; k > 3u; k--) { found[k] = 0u; }",
        "for (var k = 1u; k <= 256u; k += 32u) { found[k] = 0u; }",
        "for (; a != 0u; a &= a - 1u) { found[firstTrailingBit(a)] = 0u; }",
    ] {
        let (loops, faults) = verdict(good);
        assert!(loops >= 1 && faults.is_empty(), "{good}: {faults:?}");
    }
}

#[test]
fn loops_without_a_bound_are_refused() {
    for bad in [
        "while (a > n) { a = max(a - 1u, 3u); }",
        "while (a != 0u) { a &= a - 1u; }",
        "loop { a += 1u; if (a == n) { break; } }",
        "loop { a += 1u; continuing { break if a == n; } }",
        "for (;;) { break; }",
        "for (var k = 0u; k < n;) { k += 1u; }",
        "for (var k = 0u; k < n; a++) { k += 1u; }",
        "for (var k = 0u; k < n; k++) { k -= 1u; }",
        "for (var k = 0u; k < n; k++) { stepped(&k); }",
        "for (var k = 0u; k < n; k += 256u) { a += k; }",
        "for (var k = 0u; k <= n; k++) { a += k; }",
        "for (var k = 0u; k < 0xfffffff0u; k += 32u) { a += k; }",
        "for (var k = 0u; k < 32u; k += n) { a += k; }",
        "for (var k = 0u; k < 256u; k *= 2u) { a += k; }",
        "for (var k = n; k < 256u; k *= 2u) { a += k; }",
        "for (var k = n; k >= 0u; k--) { a += k; }",
        "for (var k = n; k > 0u; k /= 1u) { a += k; }",
        "for (var k = 0u; k != n; k++) { a += k; }",
        "for (var k = 0u; k < a; k++) { a += 1u; }",
        "for (var k = 0u; k < a; k++) { stepped(&a); }",
        "for (var k = 0u; k < found[0]; k++) { a += 1u; }",
        "for (var k = 0u; k < shared_one; k++) { a += 1u; }",
        "for (var k = 0u; k < workgroupUniformLoad(&shared_one); k++) { a += 1u; }",
        "for (; a != 0u; a &= n - 1u) { found[0] = 0u; }",
        "for (; a != 0u; a &= a - 1u) { a |= n; }",
        "for (var k = 0u; k < 4u && a < n; k++) { a += 1u; }",
        "if (n > 3u) { switch (n) { case 4u: { while (a > n) {} } default: {} } }",
    ] {
        let (loops, faults) = verdict(bad);
        assert!(loops == 1 && faults.len() == 1, "{bad}: {loops} loops, {faults:?}");
    }
}
