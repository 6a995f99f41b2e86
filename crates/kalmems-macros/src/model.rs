//! The attribute `model`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{
    Attribute, Error, GenericArgument, Ident, ImplItem, Item, ItemImpl, PathArguments, Result, TraitItem,
};
use syn::{parse_quote, parse2};

pub fn expand(arguments: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let parametric = is_parametric(arguments)?;
    let mut item: Item = parse2(item)?;
    let inline: Attribute = parse_quote!(#[inline(always)]);
    let mut more = TokenStream::new();
    match &mut item {
        Item::Fn(function) if !parametric => function.attrs.push(inline),
        Item::Impl(block) => {
            if parametric {
                more = parametric_impl(block)?;
            }
            for member in &mut block.items {
                if let ImplItem::Fn(function) = member {
                    function.attrs.push(inline.clone());
                }
            }
        }
        Item::Trait(block) if !parametric => {
            for member in &mut block.items {
                if let TraitItem::Fn(function) = member
                    && function.default.is_some()
                {
                    function.attrs.push(inline.clone());
                }
            }
        }
        other => {
            let message = if parametric {
                "`model(parametric)` goes on an `impl` of `Dynamics` or `Measurement`"
            } else {
                "`model` goes on a function, an `impl` or a `trait`"
            };
            return Err(Error::new_spanned(other, message));
        }
    }
    Ok(quote!(#item #more))
}

fn is_parametric(arguments: TokenStream) -> Result<bool> {
    if arguments.is_empty() {
        return Ok(false);
    }
    let message = "the attribute `model` takes no argument but `parametric`";
    match parse2::<Ident>(arguments.clone()) {
        Ok(word) if word == "parametric" => Ok(true),
        _ => Err(Error::new_spanned(arguments, message)),
    }
}

/// The same law over the parameters of another number.
fn parametric_impl(block: &ItemImpl) -> Result<TokenStream> {
    let message = "`model(parametric)` goes on an `impl` of `Dynamics<T, N>` or `Measurement<T, N, M>`";
    let Some((_, path, _)) = &block.trait_ else {
        return Err(Error::new_spanned(&block.self_ty, message));
    };
    let refuse = || Error::new_spanned(path, message);
    let law = path.segments.last().ok_or_else(refuse)?;
    let PathArguments::AngleBracketed(given) = &law.arguments else { return Err(refuse()) };
    let mut given = given.args.iter();
    let (Some(GenericArgument::Type(number)), Some(states)) = (given.next(), given.next()) else {
        return Err(refuse());
    };
    let outputs = given.next();

    let (impl_generics, _, bounds) = block.generics.split_for_impl();
    let model = &block.self_ty;
    let varied = quote!(<Self as ::kalmems_core::Parameters<#number>>::Of<KalmemsS>);
    match (law.ident.to_string().as_str(), outputs) {
        ("Dynamics", None) => Ok(quote! {
            impl #impl_generics ::kalmems_core::ParametricDynamics<#number, #states> for #model #bounds {
                #[inline(always)]
                fn derivative_of<KalmemsS: ::kalmems_core::Over<#number>>(
                    varied: &#varied,
                    x: &[KalmemsS; #states],
                    u: &Self::Input,
                ) -> [KalmemsS; #states] {
                    let u = ::kalmems_core::Parameters::<#number>::map(u, |_, value| KalmemsS::lift(value));
                    ::kalmems_core::Dynamics::<KalmemsS, #states>::derivative(varied, x, &u)
                }
            }
        }),
        ("Measurement", Some(outputs)) => Ok(quote! {
            impl #impl_generics ::kalmems_core::ParametricMeasurement<#number, #states, #outputs>
                for #model #bounds
            {
                #[inline(always)]
                fn predict_of<KalmemsS: ::kalmems_core::Over<#number>>(
                    varied: &#varied,
                    x: &[KalmemsS; #states],
                ) -> [KalmemsS; #outputs] {
                    ::kalmems_core::Measurement::<KalmemsS, #states, #outputs>::predict(varied, x)
                }
            }
        }),
        _ => Err(refuse()),
    }
}
