// Words and numbers in the page's language. COOOLER_CATALOGUE, of other languages than English, holds the
// translation of each message, or the list of its forms by the message for one; "" says which form each
// category of Intl.PluralRules takes, as {one: 0, other: 1}.
(function () {
  "use strict";
  const catalogue = window.COOOLER_CATALOGUE || {};
  const { lang } = document.documentElement;
  const locale = `${lang || "en"}-u-nu-latn`;
  const rules = new Intl.PluralRules(locale);
  const mark = (0.5).toLocaleString(locale)[1];

  // Values go in as they are; a placeholder without one stays.
  const filled = (text, values) => text.replace(/\{(\w+)\}/g, (all, name) =>
    (Object.hasOwn(values, name) ? values[name] : all));

  const _ = (message, values = {}) => filled(catalogue[message] || message, values);

  function plural(n, one, many, values = {}) {
    const forms = [catalogue[one] || (n === 1 ? one : many)].flat();
    const form = forms[(catalogue[""] || {})[rules.select(n)]] || forms[forms.length - 1];
    return filled(form, { n: whole(n), ...values });
  }

  const whole = (n) => n.toLocaleString(locale, { useGrouping: true });
  const marked = (text) => text.replace(".", mark);
  const fixed = (number, digits) => marked(number.toFixed(digits));

  // As Python: of two equally near, the one that ends in an even digit.
  function percent(share) {
    const value = share * 100;
    return `${fixed(value % 1 === 0.25 ? value - 0.05 : value, 1)}\u202f%`;
  }

  window.COOOLER_I18N = { _, plural, whole, marked, fixed, percent };
})();
