"""Runs under an interpreter that has lerobot: reads a data set with it, or makes a small checkpoint of ACT for one."""

# pyright: reportMissingImports=false
from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

what, root = sys.argv[1], sys.argv[2]
data = LeRobotDataset("local/golem", root=root)
if what == "read":
    rows = [data[k] for k in range(len(data))]
    names = [name for name in rows[0] if name.startswith(("observation", "action", "command"))]
    out = {name: np.stack([row[name].numpy() for row in rows]) for name in names}
    out["index"] = np.array([int(row["index"]) for row in rows])
    np.savez(sys.argv[3], **out)  # pyright: ignore[reportArgumentType]
    print(json.dumps({"episodes": data.num_episodes, "frames": len(data), "task": rows[0]["task"], "fps": data.fps}))
else:
    from lerobot.configs.types import FeatureType
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    try:
        from lerobot.utils.feature_utils import dataset_to_policy_features  # from 0.6 on
    except ImportError:
        from lerobot.datasets.utils import dataset_to_policy_features

    features = dataset_to_policy_features(data.meta.features)
    kept = {name: f for name, f in features.items() if name in ("observation.state", "action") or ".images." in name}
    outputs = {name: f for name, f in kept.items() if f.type is FeatureType.ACTION}
    config = ACTConfig(
        input_features={name: f for name, f in kept.items() if name not in outputs}, output_features=outputs,
        chunk_size=8, n_action_steps=8, dim_model=32, n_heads=2, dim_feedforward=64, n_encoder_layers=1,
        n_vae_encoder_layers=1, pretrained_backbone_weights=None, device="cpu",
    )  # fmt: skip
    policy = ACTPolicy(config)
    before, after = make_pre_post_processors(config, dataset_stats=data.meta.stats)
    folder = Path(sys.argv[3])
    for part in (policy, before, after):
        part.save_pretrained(folder)
    print(json.dumps({"parameters": sum(p.numel() for p in policy.parameters())}))
