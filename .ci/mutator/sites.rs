//! Where a file can be changed, and into what: functions, operators and guards outside tests.

use std::ops::Range;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, BinOp, Block, Expr, ImplItem, Item, Signature, UnOp};

use crate::values;

/// A place of the source text, and each text that may stand there instead with what a person calls the change.
pub struct Site {
    pub place: Range<usize>,
    pub line: usize,
    pub function: String,
    /// The place is the empty one behind a body's brace; its changes give a value back at once.
    pub is_body: bool,
    pub changes: Vec<(String, String)>,
}

pub struct Sites<'text> {
    text: &'text str,
    /// The names around the place, outermost first.
    names: Vec<String>,
    pub found: Vec<Site>,
}

/// All sites of one file.
pub fn of_file(text: &str) -> syn::Result<Vec<Site>> {
    let mut sites = Sites { text, names: Vec::new(), found: Vec::new() };
    sites.visit_file(&syn::parse_file(text)?);
    Ok(sites.found)
}

impl Sites<'_> {
    fn source(&self, part: &impl Spanned) -> &str {
        &self.text[part.span().byte_range()]
    }

    fn add(&mut self, place: &impl Spanned, changes: Vec<(String, String)>) {
        let (line, function) = (place.span().start().line, self.names.join("::"));
        self.found.push(Site { place: place.span().byte_range(), line, function, is_body: false, changes });
    }

    fn function(&mut self, signature: &Signature, block: &Block) {
        self.names.push(signature.ident.to_string());
        if signature.constness.is_none() {
            self.body(signature, block);
            self.visit_block(block);
        }
        self.names.pop();
    }

    /// Leaves out what would be no change, and a `Default::default` that calls itself.
    fn body(&mut self, signature: &Signature, block: &Block) {
        let span = block.span().byte_range();
        let inside = self.text[span.start + 1..span.end - 1].trim();
        let changes: Vec<(String, String)> = values::of_return(&signature.output)
            .into_iter()
            .filter(|value| {
                inside != value && !inside.is_empty() && !(signature.ident == "default" && value.starts_with("Def"))
            })
            .map(|value| (format!("return {value};"), format!("gives back {value} at once")))
            .collect();
        let (line, function) = (signature.span().start().line, self.names.join("::"));
        self.found.push(Site { place: span.start + 1..span.start + 1, line, function, is_body: true, changes });
    }
}

impl<'ast> Visit<'ast> for Sites<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            Item::Const(_) | Item::Static(_) | Item::Macro(_) | Item::Enum(_) | Item::Struct(_) => {}
            Item::Mod(part) if is_test(&part.attrs) => {}
            Item::Impl(part) if is_test(&part.attrs) || is_printing(part) => {}
            Item::Impl(part) => {
                self.names.push(self.source(&part.self_ty).to_string());
                visit::visit_item_impl(self, part);
                self.names.pop();
            }
            Item::Fn(part) if is_test(&part.attrs) => {}
            Item::Fn(part) => self.function(&part.sig, &part.block),
            other => visit::visit_item(self, other),
        }
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        match item {
            ImplItem::Fn(part) if !is_test(&part.attrs) => self.function(&part.sig, &part.block),
            _ => {}
        }
    }

    fn visit_trait_item_fn(&mut self, part: &'ast syn::TraitItemFn) {
        if let Some(block) = &part.default {
            self.function(&part.sig, block);
        }
    }

    fn visit_expr(&mut self, expr: &'ast Expr) {
        match expr {
            Expr::Binary(part) if !has_let(expr) => {
                let (left, right) = (self.source(&part.left).to_string(), self.source(&part.right).to_string());
                let was = self.source(&part.op).to_string();
                let others = others(&part.op).iter();
                let changes = others.map(|other| (format!("({left}) {other} ({right})"), format!("{was} -> {other}")));
                self.add(expr, changes.collect());
            }
            Expr::Unary(part) if !matches!(part.op, UnOp::Deref(_)) => {
                let change = (self.source(&part.expr).to_string(), format!("without {}", self.source(&part.op)));
                self.add(expr, vec![change]);
            }
            Expr::Const(_) | Expr::Path(_) => return,
            Expr::Repeat(part) => return self.visit_expr(&part.expr),
            _ => {}
        }
        visit::visit_expr(self, expr);
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        if let Some((_, guard)) = arm.guard.as_ref().filter(|(_, guard)| !has_let(guard)) {
            let change = |value: &str| (value.to_string(), format!("guard -> {value}"));
            self.add(guard, vec![change("true"), change("false")]);
        }
        visit::visit_arm(self, arm);
    }

    // Types, patterns, attributes and what stands between a path's angle brackets are constants.
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
}

/// A chain of `let` and `&&` is no value, so its own operators stay.
fn has_let(expr: &Expr) -> bool {
    match expr {
        Expr::Let(_) => true,
        Expr::Binary(part) => has_let(&part.left) || has_let(&part.right),
        _ => false,
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    let tests = |list: &syn::MetaList| list.path.is_ident("cfg") && list.tokens.to_string() == "test";
    attributes.iter().any(|one| one.path().is_ident("test") || one.meta.require_list().is_ok_and(tests))
}

fn is_printing(part: &syn::ItemImpl) -> bool {
    let name = part.trait_.as_ref().and_then(|(_, path, _)| path.segments.last());
    name.is_some_and(|last| last.ident == "Display" || last.ident == "Debug")
}

fn others(operator: &BinOp) -> &'static [&'static str] {
    match operator {
        BinOp::Eq(_) => &["!="],
        BinOp::Ne(_) => &["=="],
        BinOp::Lt(_) => &["==", ">"],
        BinOp::Gt(_) => &["==", "<"],
        BinOp::Le(_) => &[">"],
        BinOp::Ge(_) => &["<"],
        BinOp::And(_) => &["||"],
        BinOp::Or(_) => &["&&"],
        BinOp::Add(_) => &["-", "*"],
        BinOp::Sub(_) => &["+", "/"],
        BinOp::Mul(_) => &["+", "/"],
        BinOp::Div(_) => &["%", "*"],
        BinOp::Rem(_) => &["/", "+"],
        BinOp::Shl(_) => &[">>"],
        BinOp::Shr(_) => &["<<"],
        BinOp::BitAnd(_) => &["|", "^"],
        BinOp::BitOr(_) => &["&", "^"],
        BinOp::BitXor(_) => &["|", "&"],
        BinOp::AddAssign(_) => &["-=", "*="],
        BinOp::SubAssign(_) => &["+=", "/="],
        BinOp::MulAssign(_) => &["+=", "/="],
        BinOp::DivAssign(_) => &["%=", "*="],
        BinOp::RemAssign(_) => &["/=", "+="],
        BinOp::ShlAssign(_) => &[">>="],
        BinOp::ShrAssign(_) => &["<<="],
        BinOp::BitAndAssign(_) => &["|="],
        BinOp::BitOrAssign(_) => &["&="],
        BinOp::BitXorAssign(_) => &["|=", "&="],
        _ => &[],
    }
}
