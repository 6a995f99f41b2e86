//! The derive macro `Parameters`.

use proc_macro2::{TokenStream, TokenTree};
use quote::{ToTokens, quote};
use syn::{Data, DeriveInput, Error, Field, Ident, Index, Member, Result, Type, parse_quote};

pub fn expand(item: &DeriveInput) -> Result<TokenStream> {
    let Data::Struct(data) = &item.data else {
        return Err(Error::new_spanned(&item.ident, "`Parameters` is derived for structures alone"));
    };
    let number = number(item)?;
    let mut body = Body::new(number);
    for (position, field) in data.fields.iter().enumerate() {
        let member = match &field.ident {
            Some(name) => Member::Named(name.clone()),
            None => Member::Unnamed(Index::from(position)),
        };
        body.add(field, &member)?;
    }
    Ok(body.into_impl(item))
}

/// The one type parameter.
fn number(item: &DeriveInput) -> Result<&Ident> {
    let mut parameters = item.generics.type_params();
    match (parameters.next(), parameters.next()) {
        (Some(number), None) => Ok(&number.ident),
        (None, _) => Err(Error::new_spanned(
            &item.ident,
            "`Parameters` needs the number that the structure holds as its type parameter, as in `struct Law<P>`",
        )),
        (_, Some(second)) => Err(Error::new_spanned(
            second,
            "`Parameters` is derived for structures with one type parameter, the number that they hold",
        )),
    }
}

/// What the functions of the `impl` do, field by field.
struct Body<'a> {
    number: &'a Ident,
    /// How many parameters the fields before hold.
    count: TokenStream,
    map: TokenStream,
    index_of: TokenStream,
    write_name: TokenStream,
}

impl<'a> Body<'a> {
    fn new(number: &'a Ident) -> Self {
        Self {
            number,
            count: quote!(0usize),
            map: TokenStream::new(),
            index_of: TokenStream::new(),
            write_name: TokenStream::new(),
        }
    }

    fn add(&mut self, field: &Field, member: &Member) -> Result<()> {
        let (number, first, kind) = (self.number, &self.count, &field.ty);
        let holds = mentions(kind.to_token_stream(), number);
        if is_fixed(field)? {
            if holds {
                let message = format!("what is carried over unchanged cannot hold `{number}`");
                return Err(Error::new_spanned(kind, message));
            }
            self.map.extend(quote!(#member: ::core::clone::Clone::clone(&self.#member),));
            return Ok(());
        }
        if !holds {
            let message = format!(
                "this field holds no `{number}`: `#[parameters(fixed)]` carries it over unchanged to another number"
            );
            return Err(Error::new_spanned(kind, message));
        }
        let name = match member {
            Member::Named(name) => name.to_string().trim_start_matches("r#").to_owned(),
            Member::Unnamed(index) => index.index.to_string(),
        };
        let part = quote!(<#kind as ::kalmems_core::Parameters<#number>>);
        self.map.extend(quote!(#member: #part::map_from(&self.#member, first + (#first), f),));
        if is_number(kind, number) {
            self.index_of.extend(
                quote!((#name, ::core::option::Option::None) => ::core::option::Option::Some(#first),),
            );
            self.write_name.extend(quote! {
                if index == (#first) {
                    return to.write_str(#name);
                }
            });
        } else {
            let dotted = format!("{name}.");
            self.index_of.extend(quote! {
                (#name, ::core::option::Option::Some(rest)) => #part::index_of(rest).map(|index| (#first) + index),
            });
            self.write_name.extend(quote! {
                if index < (#first) + #part::COUNT {
                    to.write_str(#dotted)?;
                    return #part::write_name(index - (#first), to);
                }
            });
        }
        self.count = quote!(#first + #part::COUNT);
        Ok(())
    }

    fn into_impl(self, item: &DeriveInput) -> TokenStream {
        let Self { number, count, map, index_of, write_name } = self;
        let name = &item.ident;
        let mut generics = item.generics.clone();
        generics.make_where_clause().predicates.push(parse_quote!(#number: ::kalmems_core::Scalar));
        let (impl_generics, own, bounds) = generics.split_for_impl();
        // The same structure with the other number in the place of the first.
        let other: TokenStream = own
            .to_token_stream()
            .into_iter()
            .map(|token| match token {
                TokenTree::Ident(word) if word == *number => Ident::new("KalmemsS", word.span()).into(),
                token => token,
            })
            .collect();
        quote! {
            impl #impl_generics ::kalmems_core::Parameters<#number> for #name #own #bounds {
                type Of<KalmemsS: ::kalmems_core::Scalar> = #name #other;
                const COUNT: usize = #count;

                #[inline(always)]
                fn map_from<KalmemsS: ::kalmems_core::Scalar>(
                    &self,
                    first: usize,
                    f: &mut impl ::core::ops::FnMut(usize, #number) -> KalmemsS,
                ) -> Self::Of<KalmemsS> {
                    #name { #map }
                }

                fn index_of(name: &str) -> ::core::option::Option<usize> {
                    let parts = match name.split_once('.') {
                        ::core::option::Option::Some((first, rest)) => (first, ::core::option::Option::Some(rest)),
                        ::core::option::Option::None => (name, ::core::option::Option::None),
                    };
                    match parts {
                        #index_of
                        _ => ::core::option::Option::None,
                    }
                }

                fn write_name(index: usize, to: &mut dyn ::core::fmt::Write) -> ::core::fmt::Result {
                    #write_name
                    ::core::result::Result::Ok(())
                }
            }
        }
    }
}

fn is_fixed(field: &Field) -> Result<bool> {
    let mut fixed = false;
    for attribute in field.attrs.iter().filter(|a| a.path().is_ident("parameters")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("fixed") {
                fixed = true;
                Ok(())
            } else {
                Err(meta.error("the only word here is `fixed`"))
            }
        })?;
    }
    Ok(fixed)
}

fn is_number(kind: &Type, number: &Ident) -> bool {
    matches!(kind, Type::Path(path) if path.qself.is_none() && path.path.is_ident(number))
}

fn mentions(tokens: TokenStream, number: &Ident) -> bool {
    tokens.into_iter().any(|token| match token {
        TokenTree::Ident(word) => word == *number,
        TokenTree::Group(group) => mentions(group.stream(), number),
        _ => false,
    })
}
