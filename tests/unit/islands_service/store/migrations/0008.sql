BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0008');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('08c058abacde46beb2afecdd91f50bfa','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('8dbce86efec248fd8f8167e455818751','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79540815101700282092e+09,'cancel-job','alice','4fc51c113aa043f9a3acb5ed04406c5f','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79540815102698063853e+09,'delete-job','alice','4fc51c113aa043f9a3acb5ed04406c5f',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, source TEXT, idle_since FLOAT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79540815088600373269e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv',NULL);
CREATE TABLE deliveries (
	id VARCHAR(32) NOT NULL, 
	webhook_id VARCHAR(32) NOT NULL, 
	event VARCHAR(32) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	body TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at FLOAT, 
	attempted FLOAT, 
	delivered FLOAT, 
	status INTEGER, 
	error TEXT, 
	CONSTRAINT pk_deliveries PRIMARY KEY (id), 
	CONSTRAINT fk_deliveries_webhook_id FOREIGN KEY(webhook_id) REFERENCES webhooks (id) ON DELETE CASCADE
);
INSERT INTO "deliveries" VALUES('3bc12d7be8ad440c92d8f12456b7ad9c','b4acbe41a42a4fe6a7cae5c96cf6f683','job.succeeded','08c058abacde46beb2afecdd91f50bfa','{"type":"job.succeeded","timestamp":"2026-11-23T04:29:10.950+00:00","data":{"job":"08c058abacde46beb2afecdd91f50bfa","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/08c058abacde46beb2afecdd91f50bfa","result":"/v1/jobs/08c058abacde46beb2afecdd91f50bfa/result","report":"/v1/jobs/08c058abacde46beb2afecdd91f50bfa/report"}}}',1.7954081509500145912e+09,0,1.7954081509500145912e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('71fd96a343d04d3d877f029ef85822db',1,'queued','{}',1.79540815090801119799e+09);
INSERT INTO "events" VALUES('71fd96a343d04d3d877f029ef85822db',2,'cancelled','{}',1.79540815091400599479e+09);
INSERT INTO "events" VALUES('08c058abacde46beb2afecdd91f50bfa',1,'queued','{}',1.7954081509220123291e+09);
INSERT INTO "events" VALUES('08c058abacde46beb2afecdd91f50bfa',2,'running','{"attempt": 1}',1.79540815093601346021e+09);
INSERT INTO "events" VALUES('08c058abacde46beb2afecdd91f50bfa',3,'progress','{"generation": 3}',1.79540815094200825689e+09);
INSERT INTO "events" VALUES('08c058abacde46beb2afecdd91f50bfa',4,'succeeded','{"best": 0.5}',1.7954081509500145912e+09);
INSERT INTO "events" VALUES('8dbce86efec248fd8f8167e455818751',1,'queued','{}',1.79540815096099829677e+09);
INSERT INTO "events" VALUES('8dbce86efec248fd8f8167e455818751',2,'running','{"attempt": 1}',1.79540815096598720549e+09);
INSERT INTO "events" VALUES('8dbce86efec248fd8f8167e455818751',3,'progress','{"generation": 3}',1.79540815096900463108e+09);
INSERT INTO "events" VALUES('8dbce86efec248fd8f8167e455818751',4,'failed','{"type": "broken", "detail": "it broke"}',1.79540815097801685334e+09);
INSERT INTO "events" VALUES('f9f767fa00194f878d27b53d73880dd7',1,'queued','{}',1.79540815099298357968e+09);
INSERT INTO "events" VALUES('f9f767fa00194f878d27b53d73880dd7',2,'cancelled','{}',1795408151.00099);
INSERT INTO "events" VALUES('f8a447c6f14f4cfa840aa60f285df923',1,'queued','{}',1.79540815103301548954e+09);
INSERT INTO "events" VALUES('f8a447c6f14f4cfa840aa60f285df923',2,'running','{"attempt": 1}',1.79540815104198741907e+09);
INSERT INTO "events" VALUES('f8a447c6f14f4cfa840aa60f285df923',3,'progress','{"generation": 5}',1.79540815104898810383e+09);
INSERT INTO "events" VALUES('1727d162648744d4b4c3b0e958e27613',1,'queued','{}',1.79540815105699443814e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, islands INTEGER DEFAULT 1 NOT NULL, monitor_id VARCHAR(32), record_number BIGINT, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('71fd96a343d04d3d877f029ef85822db','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79540815090801119799e+09,1.79540815091400599479e+09,NULL,1.79540815091400599479e+09,'0.1.0',NULL,NULL,0.0,'',1,'395685bf22ce47fe9d1d57c2594d0f21',1);
INSERT INTO "jobs" VALUES('08c058abacde46beb2afecdd91f50bfa','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79541175093601346017e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.7954081509220123291e+09,1.7954081509500145912e+09,1.79540815093601346021e+09,1.7954081509500145912e+09,'0.1.0','0.1.0','0.1.0',0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('8dbce86efec248fd8f8167e455818751','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79541175096598720553e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79540815096099829677e+09,1.79540815097801685334e+09,1.79540815096598720549e+09,1.79540815097801685334e+09,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('f9f767fa00194f878d27b53d73880dd7','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79540815099298357968e+09,1795408151.00099,NULL,1795408151.00099,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('f8a447c6f14f4cfa840aa60f285df923','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'89e21202031d47ee9875a2b2e8ac18dd',1,1.79540815004198741917e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79540815103301548954e+09,1.79540815104898810383e+09,1.79540815104198741907e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL);
INSERT INTO "jobs" VALUES('1727d162648744d4b4c3b0e958e27613','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79540815105699443814e+09,1.79540815105699443814e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL);
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('d861c76e84dd21b9','alice','revoked','e497a997bb44dff2a3fa72bcc51b6bee39ee8310b5258fdf7cb2e92c498de2e6','["read", "write"]',1795408150.87502,1795411750.87502,1.79540815088198041915e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('08c058abacde46beb2afecdd91f50bfa',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('08c058abacde46beb2afecdd91f50bfa',2,'{"fitness": 0.7}','second');
CREATE TABLE monitors (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	priority INTEGER NOT NULL, 
	version BIGINT NOT NULL, 
	submitted BIGINT NOT NULL, 
	status VARCHAR(16) NOT NULL, 
	records BIGINT NOT NULL, 
	alarms BIGINT NOT NULL, 
	state TEXT, 
	document TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	islands_version VARCHAR(64), 
	CONSTRAINT pk_monitors PRIMARY KEY (id)
);
INSERT INTO "monitors" VALUES('395685bf22ce47fe9d1d57c2594d0f21','alice','press','{"input": "u"}',0,0,1,'waiting',0,0,NULL,NULL,1.79540815089799308777e+09,1.79540815089799308777e+09,NULL);
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, max_islands BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('08c058abacde46beb2afecdd91f50bfa',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('8dbce86efec248fd8f8167e455818751',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('f8a447c6f14f4cfa840aa60f285df923',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('08c058abacde46beb2afecdd91f50bfa','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','4fc51c113aa043f9a3acb5ed04406c5f','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79540815101599693292e+09);
CREATE TABLE webhooks (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	url TEXT NOT NULL, 
	events TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	created FLOAT NOT NULL, 
	busy_until FLOAT DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_webhooks PRIMARY KEY (id)
);
INSERT INTO "webhooks" VALUES('b4acbe41a42a4fe6a7cae5c96cf6f683','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_+y1baevPXmzJ9BVPwNWvwvyEZleI5V56LMVFpCtupkE=',1.79540815089099264141e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id, islands);
CREATE INDEX ix_monitors_owner_created_id ON monitors (owner, created, id);
CREATE INDEX ix_jobs_monitor ON jobs (monitor_id, state, record_number) WHERE monitor_id IS NOT NULL;
COMMIT;
