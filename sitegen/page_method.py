"""The method page: what the numbers mean, who made the captions, and how to check all of it."""

from pipeline.prompts import templates
from sitegen.blocks import blocks
from sitegen.contexts import MethodPage, ModelView, PromptView, Shell
from sitegen.failures import FailureKind, meaning_of, name_of
from sitegen.gathered import SiteData
from sitegen.judgements import agreement_table
from sitegen.language import N_, fixed, said_again
from sitegen.language import gettext as _
from sitegen.mentions import rule
from sitegen.words import visible

MODELS = (
    ModelView(
        N_("Text embedder"),
        "all-MiniLM-L6-v2, fp32",
        "Apache-2.0",
        N_("Scores every caption; part of the signature"),
    ),
    ModelView(N_("Noun chunks"), "spaCy en_core_web_sm", "MIT", N_("Track 2: elements in the answers")),
    ModelView(
        N_("Vision agent (baseline)"),
        N_("EfficientNet-Lite0 on box crops, with the tracks' motion"),
        "Apache-2.0",
        N_("Stands in for the paper's vision-language models; works without a network"),
    ),
    ModelView(
        N_("Language agent (baseline)"),
        N_("Fixed rules over spaCy and the embedder"),
        N_("MIT (this project)"),
        N_("Stands in for the paper's language model; same input, same output"),
    ),
    ModelView(
        N_("Image-text matcher (baseline)"),
        N_("ConSE: the classifier's classes, averaged as text"),
        N_("Apache-2.0 weights"),
        N_("Stands in for CLIP in the verification"),
    ),
)

# One line a file, "hash  path", sorted, hashed; a page counts with its own footer's hash left out.
VERIFY = """blank='s|id="tree-sha256">[0-9a-f]*<|id="tree-sha256"><|'
find . -type f ! -name '.*' | sed 's|^./||' | while read -r f; do
  case "$f" in
    *.html) hash=$(sed "$blank" "$f" | sha256sum) ;;
    *) hash=$(sha256sum < "$f") ;;
  esac
  echo "${hash%% *}  $f"
done | LC_ALL=C sort | sha256sum"""

PROBES = {
    "constant": (N_("Constant caption"), N_("Of the videos with captions, how many get the most common one")),
    "word-bag": (
        N_("Bag of common words"),
        N_("How many captions string common words together without a sentence"),
    ),
    "shuffled": (
        N_("Shuffled videos"),
        N_("How much of BESM is left when every video has the captions of others"),
    ),
    "stuffing": (N_("Many captions a video"), N_("How many captions a video with captions has on average")),
    "near-copy": (
        N_("Near copy"),
        N_("In how many videos another submission has the same captions, or nearly"),
    ),
    "truth-copy": (
        N_("The truth's own words"),
        N_("How many hazards are described in exactly the words of the truth"),
    ),
}

SIGNATURE_PARTS = (
    ("coooler", N_("version of the metric's definition")),
    ("emb", N_("the embedding model and the hash of its weights and tokenizer")),
    ("truth", N_("hash of the truth's content, whatever its file format")),
    ("n", N_("number of videos in the truth: every mean is over all of them")),
    ("thr", N_("a caption detects its hazard when its similarity is above this")),
    ("nohaz", N_("rule for a video without a hazard: 1 for silence, 0 for any caption")),
    ("clip", N_("each pair's cosine is clipped to 0–1 before any mean")),
)


def method_page(data: SiteData, shell: Shell) -> MethodPage:
    """The context of method.html."""
    signature = str(data.systems[0].evaluation.card.signature) if data.systems else ""
    prompts = tuple(
        PromptView(name, part["section"], part["system"], part["user"], part["format_hint"])
        for name, part in templates().items()
    )
    systems = tuple((visible(s.name), s.slug, visible(said_again(s.agents))) for s in data.systems)
    attribution = blocks("\n".join(visible(line) for line in data.attribution.splitlines()))
    if attribution and attribution[0].kind == "heading":
        attribution = attribution[1:]
    short = [place for place, block in enumerate(attribution) if block.kind == "paragraph"][:1]
    cut = short[0] + 1 if short else len(attribution)
    return MethodPage(
        shell,
        data.hidden,
        fixed(data.settings.threshold, 2),
        signature,
        _probes(data),
        tuple((part, _(meaning)) for part, meaning in SIGNATURE_PARTS),
        prompts,
        tuple(ModelView(_(row.part), _(row.name), _(row.licence), _(row.role)) for row in MODELS),
        systems,
        attribution[:cut],
        attribution[cut:],
        agreement_table(data.votes, {system.slug: system.evaluation for system in data.systems}),
        rule(),
        tuple((name_of(kind), meaning_of(kind)) for kind in FailureKind),
        VERIFY,
    )


def _probes(data: SiteData) -> tuple[tuple[str, str, str], ...]:
    """Each probe's name, what it measures, and from where on it speaks."""
    thresholds = {probe.kind: probe.threshold_text for system in data.systems for probe in system.probes}
    return tuple(
        (_(name), _(meaning), said_again(thresholds.get(kind, "–")))
        for kind, (name, meaning) in PROBES.items()
    )
