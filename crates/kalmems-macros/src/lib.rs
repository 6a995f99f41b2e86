//! One attribute: it marks the functions of a model for inlining.

use proc_macro::TokenStream;
use quote::quote;
use syn::{ImplItem, Item, TraitItem, parse_macro_input, parse_quote};

/// Puts `#[inline(always)]` on a function, or on every function of an `impl` or `trait`.
///
/// A filter is fast because its model dissolves into it. One model function that the compiler decides to call
/// instead can cost more than the rest of the step, and nothing warns of it; so models carry this attribute, and
/// none of their functions can be forgotten.
///
/// ```
/// struct Spring(f64);
/// #[kalmems_macros::model]
/// impl Spring {
///     fn force(&self, x: f64) -> f64 {
///         -self.0 * x
///     }
/// }
/// assert_eq!(Spring(2.0).force(3.0), -6.0);
/// ```
#[proc_macro_attribute]
pub fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    let arguments = proc_macro2::TokenStream::from(arguments);
    if !arguments.is_empty() {
        let message = "the attribute `model` takes no arguments";
        return syn::Error::new_spanned(arguments, message).to_compile_error().into();
    }
    let mut item = parse_macro_input!(item as Item);
    let inline: syn::Attribute = parse_quote!(#[inline(always)]);
    match &mut item {
        Item::Fn(function) => function.attrs.push(inline),
        Item::Impl(block) => {
            for member in &mut block.items {
                if let ImplItem::Fn(function) = member {
                    function.attrs.push(inline.clone());
                }
            }
        }
        Item::Trait(block) => {
            for member in &mut block.items {
                if let TraitItem::Fn(function) = member
                    && function.default.is_some()
                {
                    function.attrs.push(inline.clone());
                }
            }
        }
        other => {
            let message = "`model` goes on a function, an `impl` or a `trait`";
            return syn::Error::new_spanned(other, message).to_compile_error().into();
        }
    }
    quote!(#item).into()
}
