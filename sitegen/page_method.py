"""The method page: what the numbers mean, who made the captions, and how to check all of it."""

from pipeline.prompts import templates
from sitegen.blocks import blocks
from sitegen.contexts import MethodPage, ModelView, PromptView, Shell
from sitegen.failures import NAMES, SENTENCES, FailureKind
from sitegen.gathered import SiteData
from sitegen.judgements import agreement_table
from sitegen.mentions import RULE
from sitegen.words import visible

MODELS = (
    ModelView(
        "Text embedder", "all-MiniLM-L6-v2, fp32", "Apache-2.0", "Scores every caption; part of the signature"
    ),
    ModelView("Noun chunks", "spaCy en_core_web_sm", "MIT", "Track 2: elements in the answers"),
    ModelView(
        "Vision agent (baseline)",
        "EfficientNet-Lite0 on box crops, with the tracks' motion",
        "Apache-2.0",
        "Stands in for the paper's vision-language models; works without a network",
    ),
    ModelView(
        "Language agent (baseline)",
        "Fixed rules over spaCy and the embedder",
        "MIT (this project)",
        "Stands in for the paper's language model; same input, same output",
    ),
    ModelView(
        "Image-text matcher (baseline)",
        "ConSE: the classifier's classes, averaged as text",
        "Apache-2.0 weights",
        "Stands in for CLIP in the verification",
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
    "constant": ("Constant caption", "Of the videos with captions, how many get the most common one"),
    "word-bag": ("Bag of common words", "How many captions string common words together without a sentence"),
    "shuffled": ("Shuffled videos", "How much of BESM is left when every video has the captions of others"),
    "stuffing": ("Many captions a video", "How many captions a video with captions has on average"),
    "near-copy": ("Near copy", "In how many videos another submission has the same captions, or nearly"),
    "truth-copy": (
        "The truth's own words",
        "How many hazards are described in exactly the words of the truth",
    ),
}

SIGNATURE_PARTS = (
    ("coooler", "version of the metric's definition"),
    ("emb", "the embedding model and the hash of its weights and tokenizer"),
    ("truth", "hash of the truth's content, whatever its file format"),
    ("n", "number of videos in the truth: every mean is over all of them"),
    ("thr", "a caption detects its hazard when its similarity is above this"),
    ("nohaz", "rule for a video without a hazard: 1 for silence, 0 for any caption"),
    ("clip", "each pair's cosine is clipped to 0–1 before any mean"),
)


def method_page(data: SiteData, shell: Shell) -> MethodPage:
    """The context of method.html."""
    signature = str(data.systems[0].evaluation.card.signature) if data.systems else ""
    prompts = tuple(
        PromptView(name, part["section"], part["system"], part["user"], part["format_hint"])
        for name, part in templates().items()
    )
    systems = tuple((visible(s.name), s.slug, visible(s.agents)) for s in data.systems)
    attribution = blocks("\n".join(visible(line) for line in data.attribution.splitlines()))
    if attribution and attribution[0].kind == "heading":
        attribution = attribution[1:]
    short = [place for place, block in enumerate(attribution) if block.kind == "paragraph"][:1]
    cut = short[0] + 1 if short else len(attribution)
    return MethodPage(
        shell,
        data.hidden,
        f"{data.settings.threshold:.2f}",
        signature,
        _probes(data),
        SIGNATURE_PARTS,
        prompts,
        MODELS,
        systems,
        attribution[:cut],
        attribution[cut:],
        agreement_table(data.votes, {system.slug: system.evaluation for system in data.systems}),
        RULE,
        tuple((NAMES[kind], SENTENCES[kind]) for kind in FailureKind),
        VERIFY,
    )


def _probes(data: SiteData) -> tuple[tuple[str, str, str], ...]:
    """Each probe's name, what it measures, and from where on it speaks."""
    thresholds = {probe.kind: probe.threshold_text for system in data.systems for probe in system.probes}
    return tuple((name, meaning, thresholds.get(kind, "–")) for kind, (name, meaning) in PROBES.items())
